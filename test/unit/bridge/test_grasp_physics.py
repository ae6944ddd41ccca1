"""What the simulated grasp must show on the whole arm: exact stick and break-away."""

from __future__ import annotations

import math

import numpy as np
import pytest

from .grasp_cases import (
    G0,
    MU_K,
    MU_S,
    RHO,
    friction_used,
    grasp,
    shaken_hold,
    slip,
    slip_speed,
)

DRIFT_M = 1e-9  # required: 1e-6 mm in 2 s
BREAK_AWAY = 0.005  # required; the grip falls by 0.05 % a tick
STUCK_M_S = 1e-12  # stick leaves rounding only
DIRECTIONS = {"x": (1.0, 0.0, 0.0), "diagonal": (1.0, -1.0, 0.0), "minus_y": (0.0, -1.0, 0.0)}


def loaded(model="stribeck", share=0.9, shaking=3.0, ticks=500, **more):
    """A shaken grasp whose grip is chosen so that the peak load is `share` of the static limit."""
    firm = grasp(gravity_on_pad=(1.0, 0.5, 0.0), offset=(0.02, 0.01, 0.0), **more)
    peaks = []
    for k in range(ticks):
        firm.step(shaken_hold(firm, k, shaking))
        peaks.append(friction_used(firm))
    grip = max(peaks) / (share * MU_S)
    simulation = grasp(gravity_on_pad=(1.0, 0.5, 0.0), offset=(0.02, 0.01, 0.0), grip=grip, model=model, **more)
    assert max(peaks) > 1.03 * min(peaks[100:]), "the vibration is felt"
    return simulation, grip


@pytest.mark.parametrize("model", ["stribeck", "coulomb"])
def test_stick_does_not_drift_at_90_percent_load_with_vibration(model):
    static = MU_S if model == "stribeck" else MU_K
    simulation, grip = loaded(model, share=0.9 * static / MU_S)
    start, peak = slip(simulation), 0.0
    for k in range(2000):
        simulation.step(shaken_hold(simulation, k, 3.0))
        peak = max(peak, friction_used(simulation) / (static * grip))
    assert peak == pytest.approx(0.9, abs=0.01)
    assert np.abs(slip(simulation) - start).max() < DRIFT_M


def test_the_same_vibration_over_the_limit_slips():
    simulation, _ = loaded(share=1.02)
    start = slip(simulation)
    for k in range(500):
        simulation.step(shaken_hold(simulation, k, 3.0))
    assert np.abs(slip(simulation) - start).max() > 1e-5


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.02, 0.01, 0.0)])
@pytest.mark.parametrize("direction", DIRECTIONS.values())
def test_break_away_at_mu_n(direction, offset):
    """The grip is let go slowly under the object's own weight; gravity and the offset are all that loads the pad."""
    mass = 0.5
    force = mass * G0 * np.array(direction) / np.linalg.norm(direction)
    torque = np.cross(-np.array(offset), force)[2]  # the weight acts at the centre of mass
    needed = math.sqrt(force @ force + (torque / RHO) ** 2) / MU_S
    simulation = grasp(gravity_on_pad=direction, offset=offset, grip=1.1 * needed)
    grip = 1.1 * needed
    while slip_speed(simulation) < STUCK_M_S:
        grip -= 0.0005 * needed
        assert grip > 0.9 * needed
        simulation.set_grip_force(grip)
        simulation.step(None)
    assert grip == pytest.approx(needed, rel=BREAK_AWAY)
