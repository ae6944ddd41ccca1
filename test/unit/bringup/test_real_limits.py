"""Every shipped scenario runs inside the real limits of the arm with every controller; the printed law may not."""

from __future__ import annotations

import pytest

from slip_vic.scenarios import scenario_names
from slip_vic_controller.safety.limit_avoidance import BRAKE_SHARE
from test.support.limits import asked, shipped

EFFORT_RATE = 1000.0
"""[N m/s], of such arms."""
CONTROLLERS = ("classical", "vic", "governed")


@pytest.mark.parametrize("name", scenario_names(1))
def test_runs_stay_within_arm_limits(name: str) -> None:
    for kind in CONTROLLERS:
        found = asked(shipped(name, kind))
        assert found.slope < EFFORT_RATE, kind
        assert found.velocity < BRAKE_SHARE, kind
        assert found.effort < 1.0, kind
        assert not found.limited, kind
        assert found.end == "ACTIVE", kind
