"""VicController: one control tick, from samples to an effort command, composed of the pure parts of this package."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_msgs_py.arrays import Array, readonly, rotate6, vector
from slip_msgs_py.errors import InputError
from slip_msgs_py.types import CartesianReference, EffortCommand, JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.arm import ArmModel, ArmTerms
from slip_vic_controller.core.attitude import AttitudeError, log_error, rpy_error
from slip_vic_controller.core.delays import Delays, measure_delays, stable_slip_gain
from slip_vic_controller.core.diagnostics import Glance, Status, TickDiagnostics, TickTerms
from slip_vic_controller.core.fast_law import FastTerms, fast_law, flatten
from slip_vic_controller.core.grasp import Contact, SlipDisplacement, integrate_slip
from slip_vic_controller.core.law import GraspTerms, LawTerms, control_law, grasp_terms
from slip_vic_controller.core.observer import Motion, ObserverState, SlipEstimate, initial_observer, last_twist, observe
from slip_vic_controller.core.observer_config import observer_config
from slip_vic_controller.core.operational import SingularityPolicy, TorqueTerms, joint_torque, posture_torque
from slip_vic_controller.core.params import ControllerParams
from slip_vic_controller.core.ramp import Tuning, make_ramp, tuning_at
from slip_vic_controller.core.safety import finite, limit_effort, refusal, safe_torque
from slip_vic_controller.core.state import ControllerState
from slip_vic_controller.core.trajectory import make_path, reference_at
from slip_vic_controller.core.tuning import gain_report, make_contacts, make_tuning, measured_twist


class TickResult(NamedTuple):
    """The command of a tick, the state for the next one, and what happened."""

    command: EffortCommand
    state: ControllerState
    diagnostics: TickDiagnostics


class LawInputs(NamedTuple):
    """All that the law depends on; previous_error (3,) [rad] {w}; slip_twist (6,) {ee}; wrenches (6,) on each pad."""

    previous_error: Array
    tuning: Tuning
    arm: ArmTerms
    wrenches: Sequence[Array]
    slip_twist: Array
    estimate: SlipEstimate | None
    displacements: tuple[SlipDisplacement, ...]
    reference: CartesianReference


class PlainTerms(NamedTuple):
    """The law by its plain form."""

    attitude: AttitudeError
    h_ee: Array
    grasp: GraspTerms
    law: LawTerms


class VicController:
    """The controller of one arm. It holds configuration only; what changes is in `ControllerState`.

    Args:
        params: checked parameters.
        urdf_text: the arm; gives kinematics, dynamics and effort limits.

    Raises:
        InputError: the parameters and the URDF do not fit.
    """

    def __init__(self, params: ControllerParams, urdf_text: str) -> None:
        self.params = params
        self.arm = ArmModel(urdf_text, params.ee_frame, params.joint_names, params.gravity)
        self.joint_names = self.arm.joint_names
        self.contacts = make_contacts(params)
        self.report = gain_report(params)
        self.tuning = make_tuning(params, self.report.used)
        self.gains, self.object_model = self.tuning.gains, self.tuning.object_model
        self._period_ns = round(1e9 * params.control_period_s)
        self._observer = observer_config(params) if params.slip_estimator == "observer" else None
        self.policy = SingularityPolicy(params.singularity.sigma_min, params.singularity.damping)
        self.path = make_path(params.trajectory)
        self._flattened = self.tuning, flatten(self.gains, self.object_model)
        self._slip_needed = params.controller == "vic"
        posture, joints = params.nullspace.posture, len(self.joint_names)
        if posture and len(posture) != joints:
            raise InputError("parameter nullspace.posture", got=f"{len(posture)} values", expected=f"{joints} or none")

    def initial_state(self, joint: JointSample) -> ControllerState:
        """Return the state before the first tick: the arm where it is, no slip, the trajectory starting here and now.

        Raises:
            InputError: the joint sample has the wrong size or is not finite.
        """
        count = len(self.joint_names)
        q = vector(joint.position, count, "joint position")
        arm = self.arm.terms(q, vector(joint.velocity, count, "joint velocity"))
        posture = self.params.nullspace.posture
        return ControllerState(
            stamp_ns=joint.stamp_ns,
            start_ns=joint.stamp_ns,
            start_position=readonly(arm.position),
            start_rotation=readonly(arm.rotation),
            posture=vector(posture, count, "posture") if posture else q,
            slips=(SlipDisplacement(readonly(np.zeros(3)), readonly(np.eye(3))),) * len(self.contacts),
            attitude_error=readonly(np.zeros(3)),
            position=q,
            delays=Delays(),
            observer=None if self._observer is None else initial_observer(self._observer, joint.stamp_ns, arm.twist),
            ramp=None,
        )

    def resume(self, state: ControllerState, joint: JointSample) -> ControllerState:
        """Return the state with which the law goes on after a time without it: what the observer knew is void."""
        if self._observer is None:
            return state
        twist = self.arm.terms(joint.position, joint.velocity).twist
        return state._replace(observer=initial_observer(self._observer, joint.stamp_ns, twist))

    def retune(self, state: ControllerState, params: ControllerParams) -> ControllerState:
        """Return the state from which gains and payload ramp to those of `params`; what else differs is ignored.

        Raises:
            InputError: the new values are refused as a whole, and nothing has changed.
        """
        target = make_tuning(params, gain_report(params).used)
        return state._replace(ramp=make_ramp(self._tuning(state), target, state.stamp_ns, params.gains.ramp_s))

    def step(
        self,
        state: ControllerState,
        joint: JointSample,
        wrenches: tuple[WrenchSample, ...],
        slips: tuple[SlipSample, ...],
        reference: CartesianReference | None = None,
        new_slips: tuple[SlipSample, ...] | None = None,
    ) -> TickResult:
        """Return command, next state and diagnostics of one tick; never raises, the command is always finite.

        Args:
            state: of the tick before, or `initial_state`.
            joint: the state to answer.
            wrenches: the latest of every contact, in the axes of its pad.
            slips: the latest of every contact, in the axes of its pad.
            reference: desired motion, or None for the built-in trajectory.
            new_slips: of the own contact, all that came since the last tick, in any order; None = the latest one.

        Implements: Eq. (21), (28), (29), the whole law.
        """
        with np.errstate(all="ignore"):  # overflow and NaN are looked for by value, a warning could be an exception
            if new_slips is None:
                new_slips = tuple(s for s in slips[:1] if s.stamp_ns != state.delays.newest_ns)
            return self._step(state, joint, wrenches, slips, reference, new_slips)

    def _step(
        self,
        state: ControllerState,
        joint: JointSample,
        wrenches: tuple[WrenchSample, ...],
        slips: tuple[SlipSample, ...],
        reference: CartesianReference | None,
        new_slips: tuple[SlipSample, ...],
    ) -> TickResult:
        joints, contacts = len(self.joint_names), len(self.contacts)
        reason = refusal(state.stamp_ns, joints, contacts, self._slip_needed, joint, wrenches, slips, reference)
        if reason:
            return self._safe(state, joint, reason)
        dt = (joint.stamp_ns - state.stamp_ns) * 1e-9
        slip_twists = [
            sample.twist * contact.slip_axes if sample.valid else _NO_SLIP
            for sample, contact in zip(slips, self.contacts, strict=True)
        ]
        tuning = self._tuning(state)
        arm = self.arm.terms(joint.position, joint.velocity)
        delays = measure_delays(state.delays, joint.stamp_ns, new_slips)
        observer, estimate = state.observer, None
        if self._observer is not None and observer is not None:
            observer, estimate = self._observe(state, observer, tuning, joint.stamp_ns, arm, wrenches, new_slips)
            slip_twists[0] = estimate.twist
        else:
            slip_twists[0] = measured_twist(self.params.measured, slip_twists[0])
            tuning = self._slowed(tuning, delays)
        displacements = tuple(integrate_slip(s, twist, dt) for s, twist in zip(state.slips, slip_twists, strict=True))
        if reference is None:
            t = (joint.stamp_ns - state.start_ns) * 1e-9 - self.params.trajectory.start_s
            reference = reference_at(self.path, t, state.start_position, state.start_rotation)
        inputs = LawInputs(
            state.attitude_error, tuning, arm, [w.wrench for w in wrenches], slip_twists[0], estimate, displacements,
            reference,
        )  # fmt: skip
        law = self._law(inputs)
        if law is None:
            return self._safe(state, joint, "the law gave no finite torque")
        tau_0 = self._posture_torque(state, joint)
        torque = joint_torque(arm.M, arm.bias, arm.J, arm.jdot_qd, law.a_C, law.h_ee, tau_0, self.policy)
        if not (torque.solved and finite(torque.torque)):
            return self._safe(state, joint, "the law gave no finite torque")
        effort, saturated = limit_effort(torque.torque, self.arm.effort_limit)
        near = ("arm",) * (torque.damping_squared > 0.0) + ("attitude",) * law.near_singular
        following = state._replace(
            stamp_ns=joint.stamp_ns,
            slips=displacements,
            attitude_error=law.attitude_error,
            position=joint.position,
            delays=delays,
            observer=observer,
            ramp=None if state.ramp is None else state.ramp.after(joint.stamp_ns),
        )
        glance = Glance(arm, reference, law)
        evaluate = partial(self._evaluate, inputs, torque)
        return _result(joint, following, "ok", "", near, effort, saturated, glance, evaluate)

    def _tuning(self, state: ControllerState) -> Tuning:
        return self.tuning if state.ramp is None else tuning_at(state.ramp, state.stamp_ns)

    def _slowed(self, tuning: Tuning, delays: Delays) -> Tuning:
        """Return the tuning with the k_s that the delays allow that were measured, where it is free to be chosen."""
        if self.params.gains.k_s_mode == "fixed":
            return tuning
        accepted = stable_slip_gain(delays, self._period_ns) / self.params.gains.k_s_margin
        return tuning if accepted >= tuning.gains.k_s else tuning._replace(gains=tuning.gains._replace(k_s=accepted))

    def _observe(
        self,
        state: ControllerState,
        observer: ObserverState,
        tuning: Tuning,
        stamp_ns: int,
        arm: ArmTerms,
        wrenches: tuple[WrenchSample, ...],
        samples: tuple[SlipSample, ...],
    ) -> tuple[ObserverState, SlipEstimate]:
        """Predict slip from the wrench and the motion of this tick, and correct it with the samples."""
        assert self._observer is not None
        R_ee = arm.rotation
        v_s = rotate6(R_ee, last_twist(self._observer, observer))
        own = [w.wrench for w in wrenches]
        grasp = grasp_terms(tuning.object_model, self._contacts(tuning), state.slips, own, R_ee, arm.twist, v_s)
        force = grasp.follow.copy()
        force[:3] -= tuning.object_model.gravity
        drag = -(R_ee @ own[0][:3]) / tuning.object_model.mass
        motion = Motion(stamp_ns, R_ee, arm.twist, grasp.follow + grasp.Phi2, force, drag, grasp.v_o[3:])
        return observe(self._observer, observer, motion, samples)

    def _contacts(self, tuning: Tuning) -> tuple[Contact, ...]:
        if tuning is self.tuning:
            return self.contacts
        return (self.contacts[0]._replace(position=tuning.contact_position), *self.contacts[1:])

    def _law(self, inputs: LawInputs) -> FastTerms | None:
        """Evaluate the law for a tick, by its fast form where there is one; None where a number left its range."""
        params = self.params
        if params.attitude == "rpy":
            return glance_of(self._plain_law(inputs))
        tuning, estimate = inputs.tuning, inputs.estimate
        if tuning is not self._flattened[0]:
            self._flattened = tuning, flatten(tuning.gains, tuning.object_model)
        error = estimate.error if estimate is not None and params.observer.correct_follow else None
        try:
            return fast_law(
                self._flattened[1], self._contacts(tuning), inputs.displacements, inputs.wrenches, inputs.slip_twist,
                error, inputs.arm, inputs.reference, params.feed_forward, inputs.previous_error,
            )  # fmt: skip
        except ArithmeticError:
            return None

    def _plain_law(self, inputs: LawInputs) -> PlainTerms:
        """Evaluate the law by the formulas of the documentation, for a slip velocity wherever it comes from."""
        params, tuning, arm, reference = self.params, inputs.tuning, inputs.arm, inputs.reference
        R_ee, v_ee, wrenches, estimate = arm.rotation, arm.twist, inputs.wrenches, inputs.estimate
        v_s = rotate6(R_ee, inputs.slip_twist)
        h_ee = rotate6(R_ee, wrenches[0])
        contacts = self._contacts(tuning)
        grasp = grasp_terms(tuning.object_model, contacts, inputs.displacements, wrenches, R_ee, v_ee, v_s)
        if estimate is not None and params.observer.correct_follow:
            grasp = grasp._replace(follow=grasp.follow + rotate6(R_ee, estimate.error))
        a_d = reference.acceleration if params.feed_forward else _NO_SLIP
        R_d, w_d = reference.rotation, reference.twist[3:]
        if params.attitude == "rpy":
            attitude = rpy_error(R_ee, R_d, v_ee[3:], w_d)
        else:
            attitude = log_error(R_ee, R_d, v_ee[3:], w_d, a_d[3:], inputs.previous_error)
        e_p, e_p_dot = arm.position - reference.position, v_ee[:3] - reference.twist[:3]
        law = control_law(tuning.gains, contacts[0].slip_axes, attitude, e_p, e_p_dot, a_d, R_ee, v_s, grasp)
        return PlainTerms(attitude, h_ee, grasp, law)

    def _posture_torque(self, state: ControllerState, joint: JointSample) -> Array:
        nullspace = self.params.nullspace
        return posture_torque(joint.position, joint.velocity, state.posture, nullspace.stiffness, nullspace.damping)

    def _evaluate(self, inputs: LawInputs, torque: TorqueTerms) -> TickTerms:
        """Make the record of a tick, when somebody looks at it."""
        tuning = inputs.tuning
        with np.errstate(all="ignore"):
            plain = self._plain_law(inputs)
        return TickTerms(
            tuning.gains,
            tuning.object_model,
            inputs.arm,
            inputs.reference,
            plain.attitude,
            inputs.displacements[0],
            plain.h_ee,
            plain.grasp,
            plain.law,
            torque,
            inputs.estimate,
        )

    def _safe(self, state: ControllerState, joint: JointSample, reason: str) -> TickResult:
        """Hold the arm against gravity and brake its joints, from the last finite joint state."""
        size = state.position.shape
        q = joint.position if joint.position.shape == size and finite(joint.position) else state.position
        qd = joint.velocity if joint.velocity.shape == size and finite(joint.velocity) else None
        torque = safe_torque(self.arm.gravity(q), qd, self.params.safety.joint_damping)
        effort, saturated = limit_effort(torque, self.arm.effort_limit)
        following = state._replace(stamp_ns=max(joint.stamp_ns, state.stamp_ns), position=q)
        return _result(joint, following, "safe", reason, (), effort, saturated, None, None)


def _result(
    joint: JointSample,
    state: ControllerState,
    status: Status,
    reason: str,
    near_singular: tuple[str, ...],
    effort: Array,
    saturated: NDArray[np.bool_],
    glance: Glance | None,
    evaluate: Callable[[], TickTerms] | None,
) -> TickResult:
    """Put a tick's result together and make all its arrays read-only."""
    for array in (effort, saturated, state.attitude_error, *itertools.chain.from_iterable(state.slips)):
        array.flags.writeable = False
    diagnostics = TickDiagnostics(status, reason, near_singular, effort, saturated, glance, evaluate)
    return TickResult(EffortCommand(joint.stamp_ns, effort), state, diagnostics)


def glance_of(plain: PlainTerms) -> FastTerms:
    """Return what a tick needs of a law that was evaluated by its plain form.

    Implements: ours: roll, pitch, yaw have no fast form.
    """
    law, grasp, e, v_s = plain.law, plain.grasp, plain.law.e, plain.law.v_s
    return FastTerms(
        law.a_C, plain.h_ee, plain.attitude.error, plain.attitude.near_singular, law.gate,
        math.sqrt(e[:3].dot(e[:3])), math.sqrt(e[3:].dot(e[3:])), math.sqrt(v_s[:3].dot(v_s[:3])),
        grasp.a_o[:3], (grasp.follow + grasp.Phi2)[:3],
    )  # fmt: skip


_NO_SLIP = readonly(np.zeros(6))
