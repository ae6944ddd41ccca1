"""What all plants take from MuJoCo: the arm from the URDF text that the controller reads too, pad, object, sensors.

A massless body at the pad centre carries the force and torque sensors, so they read the wrench of the robot on the
object at the pad centre, on its axes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import mujoco
import numpy as np

from slip_core.arrays import Array, inertia_from_six, readonly
from slip_core.errors import InputError
from slip_core.files.urdf import named, numbers_of, parse_urdf, usable_urdf
from slip_core.grasp_params import ObjectParams
from slip_core.records import WholeArray
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.plant import DivergenceError

PAD = "grasp_pad"
OBJECT = "grasp_object"
_SENSORS = {"grasp_force": mujoco.mjtSensor.mjSENS_FORCE, "grasp_torque": mujoco.mjtSensor.mjSENS_TORQUE}
_FATAL_WARNINGS = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


def arm_spec(params: BridgeParams, urdf_text: str) -> mujoco.MjSpec:
    """Return the arm as an editable spec with the options of this simulator: dense, no silent reset, no joint damping.

    Raises:
        InputError: where the URDF does not parse or lacks the frame or a joint.
    """
    try:
        spec = mujoco.MjSpec.from_string(usable_urdf(urdf_text, params.ee_frame, params.joint_names))
    except ValueError as error:
        raise InputError("robot_description", got=str(error), expected="a URDF") from None
    spec.compiler.fusestatic = False
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    spec.option.gravity = params.gravity
    spec.option.timestep = params.control_period_s

    armature = dict(zip(params.joint_names, params.drive.of_joints("armature", len(params.joint_names)), strict=True))
    for joint in spec.joints:
        joint.damping = np.zeros(3)
        joint.frictionloss = 0.0
        joint.armature = armature[joint.name]
    return spec


def free_object_model(arms: Mapping[str, BridgeParams], urdfs: Mapping[str, str]) -> mujoco.MjModel:
    """Compile all arms, each on its base with a site `PAD` at its pad centre, and the free object, the last body.

    Names of an arm have the prefix `name_of`.

    Raises:
        InputError: a URDF that does not parse or lacks the frame or a joint.
    """
    whole = mujoco.MjSpec()
    for name, arm in arms.items():
        spec = arm_spec(arm, urdfs[name])
        spec.body(arm.ee_frame).add_site(name=PAD)
        turn, quaternion = np.array(arm.base.rotation), np.zeros(4)
        angle = float(np.linalg.norm(turn))
        mujoco.mju_axisAngle2Quat(quaternion, turn / angle if angle > 0.0 else np.array((1.0, 0.0, 0.0)), angle)
        whole.option, whole.compiler = spec.option, spec.compiler
        frame = whole.worldbody.add_frame(pos=np.array(arm.base.position), quat=quaternion)
        whole.attach(spec, prefix=name_of(name, ""), frame=frame)
    whole.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    first = next(iter(arms.values())).object
    grasped = whole.worldbody.add_body(name=OBJECT)
    give_inertia(grasped, first, np.eye(3), np.zeros(3))
    grasped.add_freejoint()
    return compile_spec(whole)


def name_of(arm: str, name: str) -> str:
    """Return the name that a body, joint or site of an arm has in the model of all arms."""
    return f"{arm or 'arm'}_{name}"


def add_pad(spec: mujoco.MjSpec, ee_frame: str) -> mujoco.MjsBody:
    """Put the body with force and torque sensors at the pad centre and return it."""
    pad = spec.body(ee_frame).add_body(name=PAD)
    site = pad.add_site(name=PAD)
    for name, kind in _SENSORS.items():
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site.name)
    return pad


def sensor_address(model: mujoco.MjModel) -> slice:
    """Return where force and torque of the pad, the only sensors, lie in `sensordata`."""
    first = int(model.sensor(next(iter(_SENSORS))).adr[0])
    return slice(first, first + 6)


def give_inertia(body: mujoco.MjsBody, of: ObjectParams, rotation: Array, place: Array) -> None:
    """Give `body` the object's mass and inertia.

    rotation, place: of the body's frame on the object's axes, from its centre of mass; (3, 3), (3,) [m].
    """
    J = rotation.T @ inertia_from_six(of.inertia) @ rotation
    body.mass, body.ipos, body.explicitinertial = of.mass, -rotation.T @ place, True
    body.fullinertia = [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]


def compile_spec(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile the spec.

    Raises:
        InputError: where MuJoCo finds the model inconsistent.
    """
    if mujoco.get_mju_user_warning() is None:  # or MuJoCo writes MUJOCO_LOG.TXT into the working folder
        mujoco.set_mju_user_warning(_ignore)  # the plants read `data.warning` and raise
    try:
        return spec.compile()
    except ValueError as error:
        raise InputError("robot_description", got=str(error), expected="a physically consistent model") from None


class UrdfJoints(NamedTuple):
    """What the URDF has of an arm's joints, 0 where it has none; (n,) each."""

    effort: Array  # N m
    lower: Array  # rad
    upper: Array  # rad
    speed: Array  # rad/s
    friction: Array  # N m
    damping: Array  # N m s/rad


def urdf_joints(params: BridgeParams, urdf_text: str) -> UrdfJoints:
    """Return `<limit>` and `<dynamics>` of the joints of an arm."""
    joints = named(parse_urdf(usable_urdf(urdf_text, params.ee_frame, params.joint_names)), "joint")

    def of(element: str, name: str) -> Array:
        return readonly([numbers_of(joints[joint].find(element), name, (0.0,))[0] for joint in params.joint_names])

    limits, dynamics = ("effort", "lower", "upper", "velocity"), ("friction", "damping")
    return UrdfJoints(*(of("limit", name) for name in limits), *(of("dynamics", name) for name in dynamics))


def tree_of(model: mujoco.MjModel) -> WholeArray:
    """Return where a row of L of the mass matrix begins, how long it is, and the column of every entry."""
    return np.concatenate((model.M_rowadr, model.M_rownnz, model.M_colind)).astype(np.int64)


def check_divergence(data: mujoco.MjData) -> None:
    """Look for MuJoCo's warnings of a state that is not physical, since the last reset.

    Raises:
        DivergenceError: there is one.
    """
    if any(data.warning[kind].number for kind in _FATAL_WARNINGS):
        raise DivergenceError(f"simulation diverged at {data.time:.4f} s; reset it, and lower gains or step size")


def _ignore(text: str) -> None:
    """Take a warning of MuJoCo's without writing it anywhere."""
