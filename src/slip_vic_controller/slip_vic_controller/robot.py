"""Kinematics and dynamics of the robot; the only file that knows Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from slip_core.arrays import Array, readonly, vector
from slip_core.errors import InputError, nearest
from slip_vic_controller.law.arm import gather
from slip_vic_controller.sizes import MAX_JOINTS


class Robot:
    """The arm of a URDF text, checked against the joint names; limits are the URDF's.

    joint_names; effort_limit (n,) [N m]; velocity_limit (n,) [rad/s]; position_lower, position_upper (n,) [rad].

    Args:
        urdf_text: the URDF.
        ee_frame: name of the frame at the pad centre.
        joint_names: the arm's joints in the order of the chain; other joints must not move {ee} and are locked at 0.
        gravity: (3,) [m/s^2] {w}.

    Raises:
        InputError: not a URDF, frame or joints missing, joints in another order, too many, no effort limit.
    """

    def __init__(
        self, urdf_text: str, ee_frame: str, joint_names: Sequence[str], gravity: Sequence[float] = (0.0, 0.0, -9.81)
    ) -> None:
        model = _parse(urdf_text)
        names = tuple(joint_names)
        _check_joints(model, names)
        frames = [frame.name for frame in model.frames]
        if ee_frame not in frames:
            raise InputError(
                "ee_frame",
                got=ee_frame,
                expected="a frame of the URDF",
                fix=nearest(ee_frame, set(frames) - {"universe"}),
            )
        ee_joint = model.frames[model.getFrameId(ee_frame)].parentJoint
        moving = [model.names[j] for j in model.supports[ee_joint] if j > 0]
        if extra := [name for name in moving if name not in names]:
            raise InputError("joint_names", got=list(names), expected=f"also {extra}, which moves {ee_frame}")
        locked = [model.getJointId(name) for name in model.names if name != "universe" and name not in names]
        if locked:
            model = pin.buildReducedModel(model, locked, pin.neutral(model))
        if model.nq != len(names):
            raise InputError(
                "URDF joints",
                got=f"{model.nq} coordinates for {len(names)} joints",
                expected="one coordinate per joint",
                fix="use revolute with limits instead of continuous",
            )
        if not (np.isfinite(model.effortLimit).all() and (model.effortLimit > 0.0).all()):
            raise InputError(
                "URDF effort limits",
                got=model.effortLimit.tolist(),
                expected="a positive <limit effort> at every joint",
            )
        model.gravity.linear = vector(gravity, 3, "gravity")
        self.joint_names = names
        self.effort_limit = readonly(model.effortLimit)
        self.velocity_limit = readonly(model.velocityLimit)
        self.position_lower = readonly(model.lowerPositionLimit)
        self.position_upper = readonly(model.upperPositionLimit)
        self._model, self._data = model, model.createData()
        frame = model.frames[model.getFrameId(ee_frame)]
        self._placement = readonly(np.concatenate((frame.placement.translation, frame.placement.rotation.ravel())))
        self._rest = np.zeros(model.nv)
        # Views of Pinocchio's own memory: they show what was computed last, and cost nothing.
        data, joint = self._data, frame.parentJoint
        pose, twist, acceleration = data.oMi[joint], data.v[joint], data.a[joint]
        motion = (pose.rotation, pose.translation, twist.linear, twist.angular)
        self._views = (*motion, acceleration.linear, acceleration.angular, data.J, data.nle, data.g, data.M)

    def terms(self, q: Array, qd: Array, arm: Array) -> None:
        """Fill the record of the arm at one state; (n,) [rad], (n,) [rad/s], ARM.

        Implements: Eq. (1), (7), (8).
        """
        self.evaluate(q, qd)
        gather(qd, self._placement, *self._views, arm)

    def evaluate(self, q: Array, qd: Array) -> None:
        """Let Pinocchio compute what `terms` gathers, and nothing else; (n,) [rad], (n,) [rad/s]."""
        model, data = self._model, self._data
        pin.computeGeneralizedGravity(model, data, q)
        pin.nonLinearEffects(model, data, q, qd)
        pin.forwardKinematics(model, data, q, qd, self._rest)
        pin.computeJointJacobians(model, data)
        pin.crba(model, data, q)

    def gravity(self, q: Array) -> Array:
        """Return the gravity torque g(q); (n,) [rad] -> (n,) [N m].

        Implements: Eq. (1), g.
        """
        return np.array(pin.computeGeneralizedGravity(self._model, self._data, q))


def _parse(urdf_text: str) -> pin.Model:
    try:
        # urdfdom prints to stderr before it fails: what is not even XML is refused first.
        if ElementTree.fromstring(urdf_text).tag != "robot":
            raise ValueError("the root element is not <robot>")
        return pin.buildModelFromXML(urdf_text)
    except (ValueError, RuntimeError, ElementTree.ParseError) as error:
        raise InputError("robot_description", got=urdf_text.strip()[:40], expected="a URDF", fix=str(error)) from None


def _check_joints(model: pin.Model, names: tuple[str, ...]) -> None:
    known = [name for name in model.names if name != "universe"]
    for name in names:
        if name not in known:
            raise InputError("joint_names", got=name, expected="a moving joint of the URDF", fix=nearest(name, known))
    if len(set(names)) != len(names):
        raise InputError("joint_names", got=list(names), expected="no name twice")
    if len(names) > MAX_JOINTS:
        raise InputError("joint_names", got=f"{len(names)} joints", expected=f"at most {MAX_JOINTS}")
    in_urdf_order = [name for name in known if name in names]
    if list(names) != in_urdf_order:
        raise InputError("joint_names", got=list(names), expected=f"the order of the URDF's chain: {in_urdf_order}")
