"""Slip, wrench and object truth against a second model in world axes: signs, points and frames of every signal."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from slip_description import urdf_text
from test.referees.arrays import rotate6, skew
from test.referees.grasp_twin import GraspTwin

from .scenes import Shaker, scenario_params, scene

EXACT = 1e-9  # two ways to the same number; rounding is 1e-13
SCENARIOS = ["paper_planar", "vertical_plane", "glass_transport"]
WITHIN_A_STEP = 1e-3  # force and slip of a step belong to contact positions one step of 0.1 ms apart
STUCK = 1e-12  # m/s: stick leaves rounding only
BREAK_AWAY = 0.005  # required; the grip falls by 0.05 % a tick
SHAKES = [(name, 11) for name in SCENARIOS]


def shaken(name, seed, ticks=400, **values):
    """A shaken scene and its twin, yielded after every tick."""
    simulation = scene(name, **values)
    twin = GraspTwin(simulation.params, urdf_text())
    for _ in Shaker(simulation, seed).run(ticks):
        yield simulation, twin


def slips_at_all(history):
    assert np.abs(history).max() > 1e-3, "the scene must really slip"


@pytest.mark.parametrize(("name", "seed"), SHAKES)
def test_slip_velocity_is_pad_minus_object_material(name, seed):
    """v_s = v_ee - G^T v_o from world-frame twists: v_ee by Pinocchio, v_o and poses from the truth."""
    history = []
    for simulation, twin in shaken(name, seed):
        joint, truth, slip = simulation.observe().joint, simulation.observe().truth, simulation.observe().slip
        x_ee, R_ee, v_ee = twin.ee_pose_and_twist(joint.position, joint.velocity)
        G = np.eye(6)
        G[3:, :3] = skew(x_ee - truth.position)
        v_s = rotate6(R_ee.T, v_ee - G.T @ truth.twist)
        np.testing.assert_allclose(slip.twist, v_s, rtol=0, atol=EXACT)
        assert np.array_equal(truth.slip_velocity, slip.twist)
        history.append(slip.twist)
    slips_at_all(history)


@pytest.mark.parametrize(("name", "seed"), SHAKES)
def test_slip_displacement_is_the_pose_of_the_pad_in_the_grasp_frame(name, seed):
    history = []
    for simulation, twin in shaken(name, seed):
        joint, truth = simulation.observe().joint, simulation.observe().truth
        x_ee, R_ee, _ = twin.ee_pose_and_twist(joint.position, joint.velocity)
        R_p = truth.rotation @ twin.o_R_p
        x_p = truth.position + truth.rotation @ twin.o_x_p
        rotation = Rotation.from_matrix(R_p.T @ R_ee).as_rotvec()
        s = np.concatenate((R_p.T @ (x_ee - x_p), rotation))
        np.testing.assert_allclose(truth.slip_displacement, s, rtol=0, atol=EXACT)
        history.append(s)
    slips_at_all(history)


@pytest.mark.parametrize(("name", "seed"), SHAKES)
def test_object_truth_matches_the_twin(name, seed):
    for simulation, twin in shaken(name, seed, ticks=200):
        truth, data = simulation.observe().truth, simulation.plant.data
        x_p, R_p, v_p = twin.p_pose_and_twist(data.qpos, data.qvel)
        R_o = R_p @ twin.o_R_p.T
        np.testing.assert_allclose(truth.rotation, R_o, rtol=0, atol=EXACT)
        np.testing.assert_allclose(truth.position, x_p - R_o @ twin.o_x_p, rtol=0, atol=EXACT)
        v_o = np.concatenate((v_p[:3] + np.cross(v_p[3:], truth.position - x_p), v_p[3:]))
        np.testing.assert_allclose(truth.twist, v_o, rtol=0, atol=EXACT)


@pytest.mark.parametrize(("name", "seed"), SHAKES)
def test_wrench_is_minus_the_force_that_moves_the_object(name, seed):
    """Newton-Euler of the twin with the step's exact joint accelerations gives the force through the pad: -h_ee."""
    simulation = scene(name)
    twin, data = GraspTwin(simulation.params, urdf_text()), simulation.plant.data
    period, biggest = simulation.params.control_period_s, 0.0
    shaker = Shaker(simulation, seed)
    for _ in range(300):
        q, v = data.qpos.copy(), data.qvel.copy()
        simulation.step(shaker.effort())
        a = (data.qvel - v) / period  # semi-implicit Euler: exactly the acceleration of the step
        pin.rnea(twin.model, twin.data, q, v, a)
        force = twin.data.f[twin.model.njoints - 1]  # by the pad on the object, at and on axes of {p}
        pin.framesForwardKinematics(twin.model, twin.data, q)
        p_in_ee = twin.data.oMf[twin.ee].actInv(twin.data.oMf[twin.p])
        h_ee = -p_in_ee.act(force).vector
        np.testing.assert_allclose(simulation.observe().wrench.wrench, h_ee, rtol=0, atol=EXACT)
        biggest = max(biggest, np.abs(data.qpos[-3:]).max())
    assert biggest > 1e-3, "the contact must have moved away from where the object was grasped"


@pytest.mark.parametrize(("name", "seed"), SHAKES)
def test_slip_dissipates_exactly_the_friction_law(name, seed):
    """In slip h_ee . v_s = -F(s) s, with s = |(vx, vy, rho wz)|; in stick the load stays below mu_s N."""
    friction, grip = scenario_params(name).friction, scenario_params(name).grip.force
    scale, slipped = np.array([1.0, 1.0, friction.torsional_radius]), 0
    for simulation, _ in shaken(name, seed, ticks=2000, control_period_s=1e-4):
        v_s, h = simulation.observe().slip.twist[[0, 1, 5]], simulation.observe().wrench.wrench[[0, 1, 5]]
        s, used = np.linalg.norm(scale * v_s), np.linalg.norm(h / scale)
        if s > 1e-9:
            mu = friction.mu_k + (friction.mu_s - friction.mu_k) * np.exp(-((s / friction.stribeck_velocity) ** 2))
            limit = mu * grip + friction.viscous * s
            assert h @ v_s == pytest.approx(-limit * s, rel=WITHIN_A_STEP)
            assert used == pytest.approx(limit, rel=WITHIN_A_STEP)
            slipped += 1
        else:
            assert used <= friction.mu_s * grip * (1.0 + 1e-9)
    assert slipped > 10


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (0.02, 0.01, 0.0)])
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (1.0, -1.0, 0.0), (0.0, -1.0, 0.0)])
def test_break_away_at_mu_n(direction, offset):
    """The grip is let go slowly under the object's own weight, which alone loads the pad, in its plane."""
    pad, params = scene().observe().pad[1], scenario_params()
    down, rho = np.array(direction) / np.linalg.norm(direction), params.friction.torsional_radius
    force = params.object.mass * 9.81 * down
    torque = np.cross(-np.array(offset), force)[2]  # the weight acts at the centre of mass
    grip = needed = np.hypot(np.linalg.norm(force), torque / rho) / params.friction.mu_s
    simulation = scene(
        gravity=tuple(9.81 * pad @ down), contacts__position=offset, contacts__orientation_xyzw=(0.0, 0.0, 0.0, 1.0),
        grip__force=1.1 * needed,
    )  # fmt: skip
    grip *= 1.1
    while np.linalg.norm(simulation.observe().slip.twist[[0, 1, 5]] * (1.0, 1.0, rho)) < STUCK:
        grip -= 0.0005 * needed
        assert grip > 0.9 * needed
        simulation.set_grip_force(grip)
        simulation.step(None)
    assert grip == pytest.approx(needed, rel=BREAK_AWAY)


@pytest.mark.parametrize("seed", [31])
def test_energy_balance(seed):
    """Kinetic and potential energy change by the work of the efforts and of the slip; error of first order."""
    losses = []
    for period in (4e-4, 2e-4, 1e-4):
        simulation = scene("paper_planar", control_period_s=period)
        shaker, plant = Shaker(simulation, seed), simulation.plant
        start, work = energy(plant), 0.0
        for _ in range(round(0.4 / period)):
            v = simulation.observe().joint.velocity
            simulation.step(shaker.effort())
            joint = simulation.observe().joint
            friction = simulation.observe().wrench.wrench[[0, 1, 5]] @ simulation.observe().slip.twist[[0, 1, 5]]
            work += period * (joint.effort @ (v + joint.velocity) / 2 + friction)
        losses.append(abs(energy(plant) - start - work))
    assert losses[2] < 0.005 * abs(work)
    assert losses[0] > 1.6 * losses[1] > 2.5 * losses[2]  # halving the step halves the error


def energy(plant) -> float:
    mujoco.mj_energyPos(plant.model, plant.data)
    mujoco.mj_energyVel(plant.model, plant.data)
    return float(plant.data.energy.sum())
