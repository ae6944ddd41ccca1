"""MuJoCo and Pinocchio agree on mass matrix and bias of arm, grasp and object, motors included."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from slip_core.params import build
from slip_core.records import new, record
from slip_description import urdf_text
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant.model import arm_spec, compile_spec
from slip_sim_bridge.plant.rigid import build_model
from slip_vic_controller.law.arm import ARM as ARM_RECORD
from slip_vic_controller.robot import Robot
from test.referees.grasp_twin import GraspTwin

PARITY = 1e-10  # required; rounding is 1e-14
STATES = 1000
ARM = 7


def random_states(model: pin.Model, seed: int, count: int):
    """Positions within the limits of the arm (and +-0.3 on the grasp's joints), velocities up to 2."""
    rng = np.random.default_rng(seed)
    low, high = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
    low[ARM:], high[ARM:] = -0.3, 0.3
    for _ in range(count):
        yield rng.uniform(low, high), rng.uniform(-2.0, 2.0, model.nv)


def mujoco_terms(model, data, q, v):
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_step1(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return M, data.qfrc_bias.copy()


def test_motors_add_their_inertia_to_the_joints_of_both_sides() -> None:
    """MuJoCo's armature is Pinocchio's, and no effort holds it at rest; the object's weight is unchanged."""
    armature = tuple(np.linspace(0.5, 0.05, ARM).tolist())
    params = build(BridgeParams, {"drive.armature": armature}, "test")
    ours, plain = compile_spec(arm_spec(params, urdf_text())), compile_spec(arm_spec(BridgeParams(), urdf_text()))
    known = Robot(urdf_text(), "ee", params.joint_names, armature=armature)
    arm, buffer = mujoco.MjData(ours), new(ARM_RECORD)
    for q, v in random_states(pin.buildModelFromXML(urdf_text()), 4, 20):
        M, bias = mujoco_terms(ours, arm, q, v)
        without, same = mujoco_terms(plain, mujoco.MjData(plain), q, v)
        np.testing.assert_allclose(M - without, np.diag(armature), rtol=0, atol=PARITY)
        np.testing.assert_allclose(bias, same, rtol=0, atol=PARITY)
        known.terms(q, v, buffer)
        np.testing.assert_allclose(record(buffer, ARM_RECORD).M[:ARM, :ARM], M, rtol=0, atol=PARITY)


@pytest.mark.parametrize("seed", [2, 3])
def test_arm_with_any_grasped_object_on_1000_random_states(seed):
    rng = np.random.default_rng(seed)
    params = build(
        BridgeParams,
        {
            "object.mass": rng.uniform(0.05, 2.0),
            "object.inertia": (2.0e-3, 1.5e-3, 1.2e-3, 2e-4, -1e-4, 3e-4),
            "contacts.position": tuple(rng.uniform(-0.1, 0.1, 3)),
            "contacts.orientation_xyzw": tuple(Rotation.random(rng=rng).as_quat()),
            "gravity": tuple(rng.uniform(-9.0, 9.0, 3)),
        },
        "test",
    )
    ours, twin = build_model(params, urdf_text()), GraspTwin(params, urdf_text())
    data = mujoco.MjData(ours)
    for q, v in random_states(twin.model, seed, STATES // 2):
        M, bias = mujoco_terms(ours, data, q, v)
        upper = pin.crba(twin.model, twin.data, q)  # Pinocchio leaves the lower triangle empty
        np.testing.assert_allclose(M, np.triu(upper) + np.triu(upper, 1).T, rtol=0, atol=PARITY)
        np.testing.assert_allclose(bias, pin.nonLinearEffects(twin.model, twin.data, q, v), rtol=0, atol=PARITY)
