"""The contact estimate: friction of the weakest pad."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from slip_core.records import new, record
from slip_vic_controller.contact.estimate import CONTACT_ESTIMATE
from slip_vic_controller.contact.friction_estimate import (
    FRICTION_CONFIG,
    Friction,
    put_certain,
    share_friction,
    take_weaker,
)


def records_of(*dtypes: np.dtype) -> list[SimpleNamespace]:
    """Return a record of each layout."""
    return [record(new(dtype), dtype) for dtype in dtypes]


@pytest.mark.parametrize(("friction", "F_lo"), [(Friction.KNOWN, 0.8), (Friction.LEARNT, 0.8), (Friction.UNKNOWN, 0.3)])
def test_certain_load(friction: Friction, F_lo: float) -> None:
    config, out = records_of(FRICTION_CONFIG, CONTACT_ESTIMATE)
    config.friction, out.F_median, out.carried = friction, 0.8, 0.3
    put_certain(config, out)
    assert out.F_lo == F_lo


def test_all_pads_have_the_weakest_friction() -> None:
    config, a, b, both = records_of(FRICTION_CONFIG, CONTACT_ESTIMATE, CONTACT_ESTIMATE, CONTACT_ESTIMATE)
    config.friction, config.quiet_ns, config.sensor_delay_ns = Friction.LEARNT, 50, 10
    for pad in (a, both):
        pad.F_lo, pad.F_median, pad.carried, pad.first = 1.0, 1.0, 0.5, 1.0
    b.F_lo, b.F_median, b.slipped_at, b.carried, b.first, b.slipping, b.slip_ns = 0.66, 0.7, 0.74, 0.6, 1.0, 1, 100
    take_weaker(both, b)
    share_friction(config, a, both, 159)
    assert (a.F_lo, a.F_median, a.slipped_at, a.carried, a.slipping) == (0.66, 0.7, 0.74, 0.5, 1)
    share_friction(config, both, both, 160)
    assert both.slipping == 0
