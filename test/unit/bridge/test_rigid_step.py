"""The implicit grasp step: every law against a referee, joint stops, memory, and what is kept as machine code."""

from __future__ import annotations

import numpy as np
import pytest

from slip_sim_bridge.friction import LAWS
from slip_sim_bridge.plant.rigid import STOP_AGREEMENT
from slip_sim_bridge.plant.rigid_step import next_point, remember
from slip_sim_bridge.simulation import Simulation
from test.referees.contact_step import joint_friction

from .scenes import Shaker, driven_into_the_stop, scene

SAME = 1e-9  # relative, and absolute below 1: two root finders at 1e-13 each, conditioned by up to 1e4

CASES = {
    "stribeck": {},
    "coulomb": {"friction__model": "coulomb"},
    "lugre": {"friction__model": "lugre", "friction__lugre__breakaway_fraction": 0.5},
    "soft lugre": {"friction__model": "lugre", "friction__lugre__stiffness": 2e3, "friction__viscous": 0.4},
    "no pressure": {"grip__force": 0.0},
    "no pressure on bristles": {"grip__force": 0.0, "friction__model": "lugre"},
    "sub-steps": {"friction__stribeck_velocity": 1e-4, "grip__force": 1.0},
    "three sub-steps": {"substeps": 3},
    "turned grasp": {"contacts__orientation_xyzw": (0.5, 0.5, -0.5, 0.5), "contacts__position": (0.02, -0.01, 0.03)},
}


@pytest.mark.parametrize("case", CASES)
def test_the_friction_of_a_step_is_the_referees(case, monkeypatch):
    monkeypatch.setattr(Simulation, "_let_go", lambda *_: False)  # the step without pressure too
    simulation = scene(**CASES[case])
    plant, slid, most = simulation.plant, 0.0, 0
    shaker = Shaker(simulation, 5, acceleration=20.0)
    for _ in shaker.run(300):
        effort, state = shaker.effort(), plant._state.copy()
        substeps = plant._solve(effort, simulation.grip_force, simulation.params.substeps, plant._no_stops, 0)
        dt = simulation.params.control_period_s / substeps
        force, following = joint_friction(
            plant.model, plant.data, simulation.params, effort, simulation.grip_force, dt, state
        )
        np.testing.assert_allclose(plant.data.qfrc_applied[-3:], force, rtol=SAME, atol=SAME)
        np.testing.assert_allclose(plant._next_state, following, rtol=SAME, atol=SAME * 1e-3)
        assert np.array_equal(plant._state, state)
        slid, most = max(slid, np.abs(simulation.observe().slip.twist).max()), max(most, substeps)
    assert slid > 1e-3, "the case must slip, or it shows little"
    assert (most > 1) == ("sub-steps" in case)


def test_friction_and_joint_stops_agree():
    """One more pass changes nothing any more: all three components have settled, not only the first that does."""
    forces = []
    for simulation in driven_into_the_stop(20.0, on_solved=lambda gap, force: forces.append((gap, force))):
        assert simulation.plant.data.nefc
    assert len(forces) > 100
    assert max(gap for gap, _ in forces) < STOP_AGREEMENT
    assert np.ptp([force[2] for _, force in forces]) > 1e-3, "the torque takes part"


def test_bristles_remember_their_strain_at_a_joint_stop():
    """What is elastic stays on the object: the deflection is the whole slip, scaled, at and off the stop."""
    touched = 0
    for simulation in driven_into_the_stop(200.0, friction__model="lugre"):
        plant, rho = simulation.plant, simulation.params.friction.torsional_radius
        np.testing.assert_allclose(plant._state, plant.data.qpos[-3:] * (1.0, 1.0, rho), rtol=1e-3, atol=1e-9)
        touched += 1
    assert touched > 100
    assert np.abs(plant._state).max() > 1e-5


def test_a_reset_leaves_no_memory_in_the_bristles():
    """The same efforts give the same bits after a reset, and the held object is at rest from the start."""
    simulation = scene(friction__model="lugre")
    fresh = scene(friction__model="lugre")
    list(Shaker(simulation, 2).run(300))
    assert np.abs(simulation.plant._state).max() > 0.0
    simulation.reset()
    assert not simulation.plant._state.any()
    assert not fresh.plant._state.any()
    assert np.array_equal(simulation.plant.read(0), fresh.plant.read(0))
    hold = fresh.observe().joint.effort
    for k in range(50):
        effort = hold + 0.5 * np.sin(0.3 * k)
        for one in (simulation, fresh):
            one.step(effort)
        assert np.array_equal(simulation.plant.read(0), fresh.plant.read(0))


@pytest.mark.parametrize("model", LAWS)
def test_nothing_pushes_a_held_object_at_the_start(model):
    """In a level pad plane friction is zero, in the first wrench too: no law starts with a strain."""
    simulation = scene(friction__model=model, contacts__position=(0.0, 0.0, 0.0))
    for _ in range(3):
        assert np.abs(simulation.observe().wrench.wrench[[0, 1, 5]]).max() < 1e-6
        assert np.abs(simulation.observe().slip.twist).max() < 1e-9
        simulation.step(None)


def test_what_is_linear_takes_two_more_values_than_it_has_unknowns():
    """Anderson's acceleration with a full memory solves x = A x + b exactly, whatever A is."""
    rng = np.random.default_rng(5)
    for n in (2, 3, 5):
        A, b = rng.normal(size=(n, n)), rng.normal(size=n)
        x, points, values, count = np.zeros(n), np.empty((n + 1, n)), np.empty((n + 1, n)), 0
        for _ in range(n + 1):
            count = remember(points, values, x, A @ x + b, count)
            next_point(points, values, count, x)
        assert np.abs(x - np.linalg.solve(np.eye(n) - A, b)).max() < 1e-9


def test_a_step_between_equal_points_says_nothing():
    """Two values at one point have no slope: the older one gets no share, and the result is finite."""
    points, values, x = np.zeros((4, 3)), np.ones((4, 3)), np.zeros(3)
    next_point(points, values, 2, x)
    assert np.array_equal(x, np.ones(3))
