"""Slip, wrench and object truth against a second model in world axes: signs, points and frames of every signal."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from slip_description import urdf_text
from test.referees.arrays import rotate6, skew
from test.referees.grasp_twin import GraspTwin

from .scenes import Shaker, scene

EXACT = 1e-9  # two ways to the same number; rounding is 1e-13
SCENARIOS = ["paper_planar", "vertical_plane", "glass_transport"]
SHAKES = [(name, 11) for name in SCENARIOS]


@pytest.mark.parametrize(("name", "seed"), SHAKES)
def test_slip_and_object_truth_are_those_of_the_twin(name, seed):
    """v_s = v_ee - G^T v_o and s from world-frame poses and twists: of the pad, and of {p} on the object."""
    simulation, history = scene(name), []
    twin, data = GraspTwin(simulation.params, urdf_text()), simulation.plant.data
    for _ in Shaker(simulation, seed).run(400):
        readings = simulation.observe()
        joint, truth, slip = readings.joint, readings.truth, readings.slip.twist
        x_ee, R_ee, v_ee = twin.ee_pose_and_twist(joint.position, joint.velocity)
        x_p, R_p, v_p = twin.p_pose_and_twist(data.qpos, data.qvel)
        R_o = R_p @ twin.o_R_p.T
        x_o = x_p - R_o @ twin.o_x_p
        v_o = np.concatenate((v_p[:3] + np.cross(v_p[3:], x_o - x_p), v_p[3:]))
        np.testing.assert_allclose(truth.object_rotation, R_o, rtol=0, atol=EXACT)
        np.testing.assert_allclose(truth.object_position, x_o, rtol=0, atol=EXACT)
        np.testing.assert_allclose(truth.object_twist, v_o, rtol=0, atol=EXACT)
        G = np.eye(6)
        G[3:, :3] = skew(x_ee - x_o)
        np.testing.assert_allclose(slip, rotate6(R_ee.T, v_ee - G.T @ v_o), rtol=0, atol=EXACT)
        assert np.array_equal(truth.slip_velocity, slip)
        s = np.concatenate((R_p.T @ (x_ee - x_p), Rotation.from_matrix(R_p.T @ R_ee).as_rotvec()))
        np.testing.assert_allclose(truth.slip_displacement, s, rtol=0, atol=EXACT)
        history.append(s)
    assert np.abs(history).max() > 1e-3, "the scene must really slip"


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
