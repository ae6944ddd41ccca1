"""The effort of HOLD for one arm and its object; the formulas are in `hold`."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array, readonly, rotate6
from slip_core.types import JointSample
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.grasp import SlipDisplacement, contact_arm, object_rotation
from slip_vic_controller.core.hold import bearable_gains, held_inertia, hold_torque, load_error
from slip_vic_controller.core.rotation import cross


class Holder:
    """Keeps a posture, with the object in the grasp. Holds configuration only.

    Args:
        controller: arm, own contact, object; of several contacts each carries its share.
    """

    def __init__(self, controller: VicController) -> None:
        safety, model = controller.params.safety, controller.object_model
        share = 1.0 / len(controller.contacts)
        self._arm, self._contact = controller.arm, controller.contacts[0]
        self._mass, self._inertia = share * model.mass, share * model.inertia
        self._weight = self._mass * model.gravity
        self._stiffness, self._damping, self._load_s = safety.hold_stiffness, safety.hold_damping, safety.hold_load_s

    def effort(
        self,
        joint: JointSample,
        slip: SlipDisplacement,
        posture: Array,
        error: Array,
        measured: Array | None,
        dt: float,
        late_s: float,
        *,
        carries: bool,
    ) -> tuple[Array, Array]:
        """Return the effort (n,) [N m] and the load error after this cycle (6,) {ee}.

        Args:
            joint: the state to answer.
            slip: displacement of the own pad on the object.
            posture: to keep; (n,) [rad].
            error: of the load, after the cycle before; (6,) [N, N m] {ee}.
            measured: wrench on the own pad {ee}, None where it is not good.
            dt: since the cycle before [s].
            late_s: how late joint states are [s].
            carries: False where the object falls, and its load is none.

        Implements: ours: HOLD.
        """
        arm = self._arm.terms(joint.position, joint.velocity)
        R_o = object_rotation(arm.rotation, self._contact, slip)
        r = contact_arm(R_o, self._contact, slip)
        # Of a resting object: HOLD begins with what is known of it, whatever the wrench says.
        load = rotate6(arm.rotation.T, np.concatenate((self._weight, -cross(r, self._weight))))
        if measured is not None:
            error = readonly(load_error(error, load, measured, dt, self._load_s))
        effort = hold_torque(
            self._arm.gravity(joint.position),
            held_inertia(arm.M, arm.J, r, self._mass, R_o.dot(self._inertia).dot(R_o.T)),
            joint.position,
            joint.velocity,
            posture,
            *bearable_gains(self._stiffness, self._damping, late_s),
        )
        if carries:
            effort = effort - arm.J.T.dot(rotate6(arm.rotation, load + error))
        return effort, error
