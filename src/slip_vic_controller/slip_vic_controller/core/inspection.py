"""The law by its plain form, from what a tick's kernel was given: its record, its numbers, and roll, pitch, yaw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array, readonly, rotate6
from slip_core.types import JointSample
from slip_vic_controller.core.arm import ArmTerms
from slip_vic_controller.core.attitude import AttitudeError, log_error, rpy_error
from slip_vic_controller.core.diagnostics import TickTerms, described, numbers_of
from slip_vic_controller.core.grasp import Contact
from slip_vic_controller.core.law import GraspTerms, LawTerms, control_law, grasp_terms
from slip_vic_controller.core.observer_memory import ObserverMemory
from slip_vic_controller.core.operational import SingularityPolicy, TorqueTerms, joint_torque, posture_torque
from slip_vic_controller.core.packing import slips_of, unpack_reference
from slip_vic_controller.core.params import ControllerParams
from slip_vic_controller.core.ramp import Tuning
from slip_vic_controller.core.record_kernel import describe
from slip_vic_controller.core.safety import finite, limit_effort
from slip_vic_controller.core.tuning import moved_contacts


class LawInputs(NamedTuple):
    """All that the law depends on.

    before, after: packed memory; packed: tuning and contacts; samples: wrench on each pad and slip twist {ee};
    follow_error (6,) {ee}; reference packed (24,); posture (n,).
    """

    before: Array
    after: Array
    tuning: Tuning
    packed: tuple[Array, Array]
    arm: ArmTerms
    joint: JointSample
    samples: Array
    follow_error: Array
    observer: ObserverMemory | None
    reference: Array
    posture: Array


class PlainTerms(NamedTuple):
    """The law by its plain form."""

    attitude: AttitudeError
    h_ee: Array
    grasp: GraspTerms
    law: LawTerms


_QUIET = np.errstate(all="ignore")

NO_SLIP = readonly(np.zeros(6))
NO_ESTIMATE = readonly(np.zeros(14))


class Inspector:
    """Evaluates the law of a tick once more, when somebody looks at it.

    Args:
        params: of the controller.
        contacts: as configured.
        policy: damping near singularities.
        settings: packed, as of the tick's kernel.
        effort_limit: (n,) [N m].
    """

    def __init__(
        self,
        params: ControllerParams,
        contacts: Sequence[Contact],
        policy: SingularityPolicy,
        settings: Array,
        effort_limit: Array,
    ) -> None:
        self._params, self._contacts, self._policy = params, contacts, policy
        self._settings, self._effort_limit = settings, effort_limit

    def plain(self, inputs: LawInputs) -> PlainTerms:
        """Evaluate the law by the formulas of the documentation, for a slip velocity wherever it comes from."""
        params, tuning, arm, reference = self._params, inputs.tuning, inputs.arm, unpack_reference(inputs.reference)
        R_ee, v_ee, contacts = arm.rotation, arm.twist, moved_contacts(self._contacts, tuning)
        wrenches = [inputs.samples[i : i + 6] for i in range(0, len(inputs.samples), 12)]
        v_s = rotate6(R_ee, inputs.samples[6:12] * contacts[0].slip_axes)
        h_ee = rotate6(R_ee, wrenches[0])
        grasp = grasp_terms(tuning.object_model, contacts, slips_of(inputs.after), wrenches, R_ee, v_ee, v_s)
        if inputs.follow_error is not NO_SLIP:
            grasp = grasp._replace(follow=grasp.follow + rotate6(R_ee, inputs.follow_error))
        a_d = reference.acceleration if params.feed_forward else NO_SLIP
        R_d, w_d = reference.rotation, reference.twist[3:]
        if params.attitude == "rpy":
            attitude = rpy_error(R_ee, R_d, v_ee[3:], w_d)
        else:
            attitude = log_error(R_ee, R_d, v_ee[3:], w_d, a_d[3:], inputs.before[:3])
        e_p, e_p_dot = arm.position - reference.position, v_ee[:3] - reference.twist[:3]
        law = control_law(tuning.gains, contacts[0].slip_axes, attitude, e_p, e_p_dot, a_d, R_ee, v_s, grasp)
        return PlainTerms(attitude, h_ee, grasp, law)

    def torque(self, inputs: LawInputs, plain: PlainTerms) -> TorqueTerms:
        """Return the joint torque of a law by its plain form."""
        arm, joint, nullspace = inputs.arm, inputs.joint, self._params.nullspace
        tau_0 = posture_torque(joint.position, joint.velocity, inputs.posture, nullspace.stiffness, nullspace.damping)
        return joint_torque(arm.M, arm.bias, arm.J, arm.jdot_qd, plain.law.a_C, plain.h_ee, tau_0, self._policy)

    @_QUIET
    def overwrite(self, inputs: LawInputs, memory: Array, out: Array) -> None:
        """Put the plain form's results in the place of the kernel's: roll, pitch, yaw have no kernel."""
        plain = self.plain(inputs)
        torque = self.torque(inputs, plain)
        law, grasp, e, v_s = plain.law, plain.grasp, plain.law.e, plain.law.v_s
        sizes = [math.sqrt(part.dot(part)) for part in (e[:3], e[3:], v_s[:3])]
        ok = torque.solved and finite(torque.torque) and finite(memory)
        effort, saturated = limit_effort(torque.torque, self._effort_limit)
        memory[:3] = plain.attitude.error
        out[:7] = ok, torque.damping_squared, plain.attitude.near_singular, law.gate, *sizes
        carried = (grasp.follow + grasp.Phi2)[:3]
        out[7:] = np.concatenate(
            (grasp.a_o[:3], carried, law.a_C, plain.h_ee, effort, torque.torque, [np.count_nonzero(saturated)])
        )

    @_QUIET
    def terms(self, inputs: LawInputs) -> TickTerms:
        """Make the record of a tick, when somebody looks at it."""
        tuning = inputs.tuning
        plain = self.plain(inputs)
        torque = self.torque(inputs, plain)
        return TickTerms(
            tuning.gains,
            tuning.object_model,
            inputs.arm,
            unpack_reference(inputs.reference),
            plain.attitude,
            slips_of(inputs.after)[0],
            plain.h_ee,
            plain.grasp,
            plain.law,
            torque,
            None if inputs.observer is None else inputs.observer.estimate,
        )

    @_QUIET
    def numbers(self, inputs: LawInputs) -> Array:
        """Work out the numbers of a tick that are plotted, when somebody does."""
        if self._params.attitude == "rpy":
            return numbers_of(self.terms(inputs))
        joint = inputs.joint
        known = NO_ESTIMATE
        if inputs.observer is not None:
            estimate = inputs.observer.estimate
            deviation = np.sqrt(estimate.variance)
            known = np.concatenate(((estimate.sliding, estimate.significance), deviation, estimate.error))
        out = np.empty(described(len(self._effort_limit)))
        describe(
            inputs.arm.record, *inputs.packed, self._settings, inputs.samples, inputs.follow_error, inputs.before,
            inputs.after, inputs.reference, joint.position, joint.velocity, inputs.posture, known, out,
        )  # fmt: skip
        return out
