"""The contact estimate: friction of the weakest pad, and how slip lies to the friction force."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from slip_core.records import new, record
from slip_core.vectors import Vec
from slip_vic_controller.contact.estimate import CONTACT_ESTIMATE, SensorHealth
from slip_vic_controller.contact.friction_estimate import (
    FRICTION_CONFIG,
    GIVES_M,
    Friction,
    put_certain,
    share_friction,
    take_weaker,
)
from slip_vic_controller.contact.wrench_evidence import WRENCH_EVIDENCE, compare_directions, start_evidence

DT = 1e-3


def records_of(*dtypes: np.dtype) -> list[SimpleNamespace]:
    """Return a record of each layout."""
    return [record(new(dtype), dtype) for dtype in dtypes]


def slide(T: np.ndarray, way: float, seed: int = 0, noise: float = 0.0) -> int:
    """Slip so far along a turning direction, read through the mounting T; return what is found."""
    (state,) = records_of(WRENCH_EVIDENCE)
    start_evidence(state)
    rng, found = np.random.default_rng(seed), int(SensorHealth.OK)
    for k in range(round(way / (0.01 * DT))):
        direction = np.array([np.cos(0.01 * k), np.sin(0.01 * k), 0.0])
        read = T @ (0.01 * direction + noise * rng.standard_normal(3))
        found = compare_directions(state, Vec(*read), Vec(*(0.2 * direction)), DT)
    return found


@pytest.mark.parametrize(
    ("T", "found"),
    [
        (np.eye(3), SensorHealth.OK),
        (np.diag((-1.0, 1.0, 1.0)), SensorHealth.X_INVERTED),
        (np.diag((1.0, -1.0, 1.0)), SensorHealth.Y_INVERTED),
        (-np.eye(3), SensorHealth.INVERTED),
        (np.eye(3)[[1, 0, 2]], SensorHealth.XY_SWAPPED),
    ],
)
def test_mounting_is_named(T: np.ndarray, found: SensorHealth) -> None:
    assert slide(T, 0.02, noise=0.002) == found
    assert slide(T, 0.9 * GIVES_M) == SensorHealth.OK, "pads give way so far, to and fro"


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_no_mounting(seed: int) -> None:
    assert slide(np.eye(3), 0.02, seed, noise=0.01) == SensorHealth.OK


def test_no_force_no_direction() -> None:
    (state,) = records_of(WRENCH_EVIDENCE)
    start_evidence(state)
    for _ in range(100):
        assert compare_directions(state, Vec(-1.0, 0.0, 0.0), Vec(0.0, 0.0, 0.0), DT) == SensorHealth.OK
    assert state.length == 0.0


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
