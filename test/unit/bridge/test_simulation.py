"""What drives make of commands, against numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_sim_bridge.simulation import drive
from slip_vic.scenarios.scenario import load_scenario


@pytest.mark.parametrize("largest_change", [0.0, 0.5, math.inf])
def test_a_drive_follows_its_rate_and_its_limit(largest_change):
    rng = np.random.default_rng(1)
    for spread in np.repeat([0.3, 3.0], 200):
        limit = np.array([1.0, 2.0, math.inf])
        last, wanted = rng.uniform(-1.0, 1.0, 3), spread * rng.standard_normal(3)
        applied = np.full(3, math.nan)
        assert drive(wanted, last, largest_change, limit, applied)
        followed = np.clip(wanted, last - largest_change, last + largest_change)
        assert np.array_equal(applied, np.clip(followed, -limit, limit))


def test_a_position_leads_a_joint_by_what_its_speed_makes_good_in_a_period() -> None:
    """A loop of bandwidth K goes 1 - exp(-K T) of the way: with that lead it moves at its speed, and no faster."""
    scenario = load_scenario("paper_planar", drive="position_250")
    arm = scenario.bridge_session().simulation.arms[0]
    period, bandwidth = scenario.bridge.control_period_s, scenario.bridge.drive.bandwidth
    posture = 0.5 * (arm.joints.lower + arm.joints.upper)
    for sign in (1.0, -1.0):
        way = arm.followable(posture + 9.0 * sign, posture) - posture
        np.testing.assert_allclose(way * (1.0 - math.exp(-bandwidth * period)), sign * arm.joints.speed * period)
    near = posture + 1e-4
    np.testing.assert_array_equal(arm.followable(near, posture), near)
    assert (arm.followable(arm.joints.upper + 1.0, arm.joints.upper - 1e-3) == arm.joints.upper).all()
