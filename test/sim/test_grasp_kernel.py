"""The compiled step and read-out against their plain forms, over shaken motion of all laws."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from slip_sim_bridge.sim.grasp_motion import slip_joint_friction
from slip_sim_bridge.sim.laws import friction_law, packed_law
from slip_sim_bridge.plant import gather

from .scenes import Shaker, scene

SAME = 1e-12  # relative, and absolute below 1

CASES = {
    "stribeck": {},
    "coulomb": {"friction__model": "coulomb"},
    "lugre": {"friction__model": "lugre", "friction__lugre__breakaway_fraction": 0.5},
    "soft lugre": {"friction__model": "lugre", "friction__lugre__stiffness": 2e3, "friction__viscous": 0.4},
    "no pressure": {"grip__force": 0.0},
    "sub-steps": {"friction__stribeck_velocity": 1e-4, "grip__force": 1.0},
    "three sub-steps": {"substeps": 3},
    "turned grasp": {"contacts__orientation_xyzw": (0.5, 0.5, -0.5, 0.5), "contacts__position": (0.02, -0.01, 0.03)},
}


def plain_friction(simulation, effort, state):
    """Friction on the relative joints, next state and number of sub-steps, by the formulas."""
    params, plant = simulation.params, simulation.plant
    model, data, n = plant.model, plant.data, len(effort)
    sides, solved = np.zeros((4, model.nv)), np.zeros((4, model.nv))
    sides[:3, n:] = np.eye(3)
    sides[3] = -data.qfrc_bias
    sides[3, :n] += effort
    mujoco.mj_solveM(model, data, solved, sides)
    return slip_joint_friction(
        solved[:, n:], data.qpos[n:], data.qvel[n:], simulation.grip_force, params.control_period_s, params.substeps,
        friction_law(params.friction), state, params.friction.torsional_radius,
    )  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_the_compiled_friction_step_is_the_plain_one(case):
    simulation = scene(**CASES[case])
    plant, slid, most = simulation.plant, 0.0, 0
    shaker = Shaker(simulation, 5, acceleration=20.0)
    for _ in shaker.run(400):
        effort, state = shaker.effort(), plant._state[:3].copy()
        force, following, substeps = plain_friction(simulation, effort, tuple(state.tolist()))
        got = plant._solve(effort, simulation.grip_force, simulation.params.substeps, plant._no_stops, 0)
        assert got == substeps
        np.testing.assert_allclose(plant.data.qfrc_applied[-3:], force, rtol=SAME, atol=SAME)
        np.testing.assert_allclose(plant._state[3:], following, rtol=SAME, atol=SAME)
        assert np.array_equal(plant._state[:3], state)
        slid, most = max(slid, np.abs(simulation.observe().slip.twist).max()), max(most, got)
    assert slid > 1e-3, "the case must slip, or it shows little"
    assert (most > 1) == ("sub-steps" in case)


@pytest.mark.parametrize("case", CASES)
def test_the_compiled_read_out_is_the_plain_one(case):
    simulation = scene(**CASES[case])
    for _ in Shaker(simulation, 6, acceleration=20.0).run(200):
        np.testing.assert_allclose(simulation.plant.read(), gather(simulation.plant), rtol=SAME, atol=SAME)
    assert np.abs(simulation.plant.object_twist()).max() > 1e-2


def test_a_law_without_kernel_is_an_error():
    with pytest.raises(TypeError, match="object"):
        packed_law(object(), 0.03)
