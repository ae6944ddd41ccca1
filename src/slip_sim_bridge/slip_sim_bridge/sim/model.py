"""The MuJoCo model of arm, grasp and object, built from the URDF text that the controller reads too.

The object hangs on the pad centre by three relative joints: slide x, slide y, hinge z of the frame `ee`. It cannot
leave the pads; how much it slips is decided by the friction law. A massless body at the pad centre carries the
force and torque sensors, so they read the wrench of the robot on the object at the pad centre, on its axes.
"""

from __future__ import annotations

import mujoco
import numpy as np

from slip_core.arrays import inertia_from_six, matrix_from_quat_xyzw
from slip_core.errors import InputError, nearest
from slip_sim_bridge.sim.params import BridgeParams

PAD = "grasp_pad"
OBJECT = "grasp_object"
SLIP_JOINTS = ("grasp_slip_x", "grasp_slip_y", "grasp_slip_rz")
FORCE_SENSOR = "grasp_force"
TORQUE_SENSOR = "grasp_torque"


def build_model(params: BridgeParams, urdf_text: str) -> mujoco.MjModel:
    """Compile arm, object and sensors for the implicit friction law; joint friction of the URDF is left out.

    Raises:
        InputError: where the URDF does not parse or lacks the frame or a joint.

    Implements: ours: object as child of {ee} with relative joints slide x, slide y, hinge z.
    """
    spec = arm_spec(params, urdf_text)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    pad = spec.body(params.ee_frame).add_body(name=PAD)
    site = pad.add_site(name=PAD)
    for name, kind in ((FORCE_SENSOR, mujoco.mjtSensor.mjSENS_FORCE), (TORQUE_SENSOR, mujoco.mjtSensor.mjSENS_TORQUE)):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site.name)

    grasped = pad.add_body(name=OBJECT)
    set_object_inertia(grasped, params)
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    for name, kind, axis in zip(SLIP_JOINTS, (slide, slide, hinge), np.eye(3), strict=True):
        grasped.add_joint(name=name, type=kind, axis=axis)
    return compile_spec(spec)


def arm_spec(params: BridgeParams, urdf_text: str) -> mujoco.MjSpec:
    """Return the arm as an editable spec with the options of this simulator: dense, no silent reset, no joint damping.

    Raises:
        InputError: where the URDF does not parse or lacks the frame or a joint.

    Implements: ours: same rigid-body arm as the controller's model.
    """
    try:
        spec = mujoco.MjSpec.from_string(urdf_text)
    except ValueError as error:
        raise InputError("robot_description", got=str(error), expected="a URDF") from None
    spec.compiler.fusestatic = False
    spec.compiler.discardvisual = False
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    spec.option.gravity = params.gravity
    spec.option.timestep = params.control_period_s

    bodies = [body.name for body in spec.bodies]
    if params.ee_frame not in bodies:
        raise InputError(
            "parameter ee_frame",
            got=params.ee_frame,
            expected=f"a link of the URDF; {nearest(params.ee_frame, bodies)}",
        )
    joints = [joint.name for joint in spec.joints]
    for name in params.joint_names:
        if name not in joints:
            raise InputError("parameter joint_names", got=name, expected=f"joints of the URDF; {nearest(name, joints)}")
    if tuple(joints) != params.joint_names:
        raise InputError(
            "parameter joint_names",
            got=list(params.joint_names),
            expected=f"all movable joints of the URDF from base to tip: {', '.join(joints)}",
        )
    for joint in spec.joints:
        joint.damping = np.zeros(3)
        joint.frictionloss = 0.0
        joint.armature = 0.0
    return spec


def set_object_inertia(body: mujoco.MjsBody, params: BridgeParams) -> None:
    """Give `body`, whose frame is the grasp frame {p}, the object's mass, centre of mass and inertia.

    Implements: ours: p_x_o = -o_R_p^T o_x_p, inertia turned to {p} axes.
    """
    o_R_p = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4])
    o_x_p = np.array(params.contacts.position[:3])
    J = o_R_p.T @ inertia_from_six(params.object.inertia) @ o_R_p
    body.mass = params.object.mass
    body.ipos = -o_R_p.T @ o_x_p
    body.fullinertia = [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]
    body.explicitinertial = True


def compile_spec(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile the spec.

    Raises:
        InputError: where MuJoCo finds the model inconsistent.

    Implements: ours: the compiler's complaint becomes one line.
    """
    if mujoco.get_mju_user_warning() is None:  # or MuJoCo writes MUJOCO_LOG.TXT into the working folder
        mujoco.set_mju_user_warning(_ignore)  # the plants read `data.warning` and raise
    try:
        return spec.compile()
    except ValueError as error:
        raise InputError("robot_description", got=str(error), expected="a physically consistent model") from None


def _ignore(text: str) -> None:
    """Take a warning of MuJoCo's without writing it anywhere."""
