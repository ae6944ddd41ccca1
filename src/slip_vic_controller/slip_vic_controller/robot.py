"""Kinematics and dynamics of the robot; the only file that uses Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from slip_core.arrays import Array, readonly, vector
from slip_core.errors import InputError
from slip_core.files.urdf import usable_urdf
from slip_vic_controller.law.arm import gather
from slip_vic_controller.sizes import MAX_JOINTS


class Robot:
    """The arm of a URDF text, checked against the joint names; limits are the URDF's.

    joint_names; effort_limit (n,) [N m]; velocity_limit (n,) [rad/s]; position_lower, position_upper (n,) [rad];
    inertia (n,) [kg m2]: what each joint moves with all at 0, its rotor with it.

    Args:
        urdf_text: the URDF.
        ee_frame: name of the frame at the pad centre.
        joint_names: the joints that move {ee}, from base to tip; all others are locked at 0.
        gravity: (3,) [m/s^2] {w}.
        armature: inertia of the motors on the side of the joints (n,) [kg m2]; none: 0.

    Raises:
        InputError: not a URDF, frame or joints missing, joints in another order, too many, limits or inertias missing.
    """

    def __init__(
        self,
        urdf_text: str,
        ee_frame: str,
        joint_names: Sequence[str],
        gravity: Sequence[float] = (0.0, 0.0, -9.81),
        armature: Sequence[float] = (),
    ) -> None:
        names = tuple(joint_names)
        if len(names) > MAX_JOINTS:
            raise InputError("joint_names", got=f"{len(names)} joints", expected=f"at most {MAX_JOINTS}")
        text = usable_urdf(urdf_text, ee_frame, names)
        try:
            model = pin.buildModelFromXML(text)
        except (ValueError, RuntimeError) as error:
            raise InputError("robot_description", got=text.strip()[:40], expected="a URDF", fix=str(error)) from None
        model.gravity.linear = vector(gravity, 3, "gravity")
        if armature:
            model.armature = vector(armature, model.nv, "armature")
        self.name = str(model.name)
        self.joint_names = names
        self.effort_limit = readonly(model.effortLimit)
        self.velocity_limit = readonly(model.velocityLimit)
        self.position_lower = readonly(model.lowerPositionLimit)
        self.position_upper = readonly(model.upperPositionLimit)
        self._model, self._data = model, model.createData()
        self._frame = model.getFrameId(ee_frame, pin.FrameType.BODY)
        frame = model.frames[self._frame]
        self._placement = readonly(np.concatenate((frame.placement.translation, frame.placement.rotation.ravel())))
        self._rest = np.zeros(model.nv)
        self.inertia = readonly(np.diag(pin.crba(model, self._data, self._rest)))
        # Views of Pinocchio's own memory: they show what was computed last, and cost nothing.
        data, joint = self._data, frame.parentJoint
        pose, twist, acceleration = data.oMi[joint], data.v[joint], data.a[joint]
        motion = (pose.rotation, pose.translation, twist.linear, twist.angular)
        self._views = (*motion, acceleration.linear, acceleration.angular, data.J, data.nle, data.g, data.M)

    def terms(self, q: Array, qd: Array, arm: Array) -> None:
        """Fill the record of the arm at one state; (n,) [rad], (n,) [rad/s], ARM.

        Implements: Eq. (1), (7), (8).
        """
        model, data = self._model, self._data
        pin.computeGeneralizedGravity(model, data, q)
        pin.nonLinearEffects(model, data, q, qd)
        pin.forwardKinematics(model, data, q, qd, self._rest)
        pin.computeJointJacobians(model, data)
        pin.crba(model, data, q)
        gather(qd, self._placement, *self._views, arm)

    def frame(self, q: Array) -> tuple[Array, Array, Array]:
        """Return position (3,) [m], rotation (3, 3) and Jacobian (6, n) of {ee} at joint positions (n,); {w}."""
        jacobian = pin.computeFrameJacobian(self._model, self._data, q, self._frame, pin.LOCAL_WORLD_ALIGNED)
        pose = pin.updateFramePlacement(self._model, self._data, self._frame)
        return np.array(pose.translation), np.array(pose.rotation), np.array(jacobian)

    def way_to(self, q: Array, position: Array, rotation: Array) -> tuple[Array, Array]:
        """Return displacement and rotation vector from {ee} to a pose, and its Jacobian; (6,), (6, n) {w}.

        q (n,); position (3,) [m], rotation (3, 3) {w}.
        """
        here, turned, J = self.frame(q)
        return np.concatenate((position - here, pin.log3(rotation @ turned.T))), J

    def placement(self, frame: str) -> tuple[Array, Array] | None:
        """Return position [m] and attitude (3, 3) of a frame of the URDF as seen from {ee}; None where it has no such.

        Raises:
            InputError: a joint is between the frame and {ee}.
        """
        model = self._model
        if not model.existFrame(frame, pin.FrameType.BODY):
            return None
        of, ee = model.frames[model.getFrameId(frame, pin.FrameType.BODY)], model.frames[self._frame]
        if of.parentJoint != ee.parentJoint:
            raise InputError(
                "parameter wrench.frame", got=frame, expected=f"a link that is fixed to {ee.name}",
                fix="set wrench.frame to a link behind the last joint",
            )  # fmt: skip
        place = ee.placement.actInv(of.placement)
        return np.array(place.translation), np.array(place.rotation)

    def gravity(self, q: Array) -> Array:
        """Return the gravity torque g(q); (n,) [rad] -> (n,) [N m].

        Implements: Eq. (1), g.
        """
        return np.array(pin.computeGeneralizedGravity(self._model, self._data, q))


def rotation_of_rpy(rpy: Sequence[float]) -> Array:
    """Return the rotation matrix (3, 3) of roll, pitch and yaw [rad], as a URDF has them."""
    return np.array(pin.rpy.rpyToMatrix(*rpy))
