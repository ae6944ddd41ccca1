"""VicController: one control tick, from samples to an effort command, composed of the pure parts of this package."""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array, readonly, vector
from slip_core.errors import InputError
from slip_core.types import CartesianReference, EffortCommand, JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.arm import ArmModel, ArmTerms
from slip_vic_controller.core.delays import Delays, measure_delays, stable_slip_gain
from slip_vic_controller.core.diagnostics import Glance, TickDiagnostics
from slip_vic_controller.core.grasp import SlipDisplacement
from slip_vic_controller.core.inspection import NO_SLIP, Inspector, LawInputs
from slip_vic_controller.core.observer_config import observer_config
from slip_vic_controller.core.observer_memory import ObserverMemory, SlipObserver
from slip_vic_controller.core.observer_run_kernel import ERROR, MOTION, VARIANCE
from slip_vic_controller.core.operational import SingularityPolicy
from slip_vic_controller.core.packing import (
    LawOutcome,
    pack_contacts,
    pack_memory,
    pack_reference,
    pack_tuning,
)
from slip_vic_controller.core.params import ControllerParams
from slip_vic_controller.core.ramp import Tuning, make_ramp, tuning_at
from slip_vic_controller.core.safety import finite, limit_effort, refusal, safe_torque
from slip_vic_controller.core.state import ControllerState
from slip_vic_controller.core.tick_kernel import evaluate, predict_motion
from slip_vic_controller.core.trajectory import make_path, packed_reference_at
from slip_vic_controller.core.tuning import gain_report, make_contacts, make_tuning, measured_twist, moved_contacts


class TickResult(NamedTuple):
    """The command of a tick, the state for the next one, and what happened."""

    command: EffortCommand
    state: ControllerState
    diagnostics: TickDiagnostics


_QUIET = np.errstate(all="ignore")
"""Overflow and NaN are looked for by value; a warning could be an exception."""


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
        self._observer = SlipObserver(observer_config(params)) if params.slip_estimator == "observer" else None
        self.policy = SingularityPolicy(params.singularity.sigma_min, params.singularity.damping)
        self.path = make_path(params.trajectory)
        self._packed: tuple[Tuning, Array, Array] | None = None
        self._accepted = math.nan, math.nan, math.nan
        self._slow_tuning: tuple[Tuning, Tuning] = self.tuning, self.tuning
        singularity, nullspace = params.singularity, params.nullspace
        settings = (float(params.feed_forward), nullspace.stiffness, nullspace.damping)
        self._settings = readonly((*settings, singularity.sigma_min, singularity.damping, *self.arm.effort_limit))
        self._inspector = Inspector(params, self.contacts, self.policy, self._settings, self.arm.effort_limit)
        self._slip_needed = params.controller == "vic"
        self._looks_first = params.attitude == "rpy"  # bad numbers must not reach the plain form
        self._dead_band = bool(params.measured.dead_band_linear or params.measured.dead_band_angular)
        self.unsaturated = np.zeros(len(self.joint_names), dtype=bool)
        self.unsaturated.setflags(write=False)
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
            memory=pack_memory(np.zeros(3), [SlipDisplacement(np.zeros(3), np.eye(3))] * len(self.contacts)),
            position=q,
            delays=Delays(),
            observer=None if self._observer is None else self._observer.initial(joint.stamp_ns, arm.twist),
            ramp=None,
        )

    def resume(self, state: ControllerState, joint: JointSample) -> ControllerState:
        """Return the state with which the law goes on after a time without it: what the observer knew is void."""
        if self._observer is None:
            return state
        twist = self.arm.terms(joint.position, joint.velocity).twist
        return state._replace(observer=self._observer.initial(joint.stamp_ns, twist))

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
        if new_slips is None:
            new_slips = slips[:1]
        q, qd, n, count = joint.position, joint.velocity, len(self.joint_names), len(self.contacts)
        samples = self._samples(wrenches, slips)
        if (
            samples is None
            or reference is not None
            or joint.stamp_ns < state.stamp_ns
            or self._looks_first
            or not q.shape == qd.shape == (n,)
        ):
            reason = refusal(state.stamp_ns, n, count, self._slip_needed, joint, wrenches, slips, reference)
            if reason or samples is None:
                return self._safe(state, joint, reason)
        tuning = self._tuning(state)
        arm = self.arm.terms(q, qd)
        delays = measure_delays(state.delays, joint.stamp_ns, new_slips)
        observer, follow_error = state.observer, NO_SLIP
        if self._observer is not None and observer is not None:
            observer = self._observe(state, observer, tuning, joint.stamp_ns, arm, samples, new_slips)
            if observer is None:
                reason = refusal(state.stamp_ns, n, count, self._slip_needed, joint, wrenches, slips, reference)
                return self._safe(state, joint, reason or "the slip observer gave no finite estimate")
            samples[6:12] = observer.now[:ERROR]
            if self.params.observer.correct_follow:
                follow_error = observer.now[ERROR:VARIANCE]
        else:
            if self._dead_band:
                samples[6:12] = self._beyond_dead_band(samples[6:12])
            tuning = self._slowed(tuning, delays)
        if reference is None:
            t = (joint.stamp_ns - state.start_ns) * 1e-9 - self.params.trajectory.start_s
            desired = packed_reference_at(self.path, t, state.start_position, state.start_rotation)
        else:
            desired = pack_reference(reference)
        memory, out = np.empty(3 + 12 * count), np.empty(LawOutcome.size(n))
        packed = self._pack(tuning)
        dt = (joint.stamp_ns - state.stamp_ns) * 1e-9
        evaluate(
            arm.record, packed[1], packed[2], self._settings, samples, follow_error, state.memory, desired, q, qd,
            state.posture, dt, memory, out,
        )  # fmt: skip
        inputs = LawInputs(
            state.memory, memory, tuning, packed[1:], arm, joint, samples, follow_error, observer, desired,
            state.posture,
        )  # fmt: skip
        if self.params.attitude == "rpy":
            self._inspector.overwrite(inputs, memory, out)
        if out[0] != 1.0:
            # What is not finite comes out as not finite: only then it is worth while to look for the cause.
            reason = refusal(state.stamp_ns, n, count, self._slip_needed, joint, wrenches, slips, reference)
            return self._safe(state, joint, reason or "the law gave no finite torque")
        memory.setflags(write=False)
        out.setflags(write=False)
        samples.setflags(write=False)
        law = LawOutcome(out, n)
        following = ControllerState(
            joint.stamp_ns,
            state.start_ns,
            state.start_position,
            state.start_rotation,
            state.posture,
            memory,
            q,
            delays,
            observer,
            None if state.ramp is None else state.ramp.after(joint.stamp_ns),
        )
        near: tuple[str, ...] = ()
        if out[1] > 0.0 or out[2]:
            near = ("arm",) * (law.damping_squared > 0.0) + ("attitude",) * law.near_singular
        effort = law.effort
        saturated = np.abs(law.torque) > self.arm.effort_limit if out[-1] else self.unsaturated
        record = TickDiagnostics(
            "ok", "", near, effort, saturated, Glance(arm, desired, law), partial(self._inspector.terms, inputs),
            partial(self._inspector.numbers, inputs),
        )  # fmt: skip
        return TickResult(EffortCommand(joint.stamp_ns, effort), following, record)

    def _samples(self, wrenches: tuple[WrenchSample, ...], slips: tuple[SlipSample, ...]) -> Array | None:
        """Return wrench and slip twist of every contact in one array, or None where something is wrong with them."""
        if not len(wrenches) == len(slips) == len(self.contacts):
            return None
        if len(wrenches) == 1:  # nearly always
            h, v = wrenches[0].wrench, slips[0].twist
            if slips[0].valid and h.shape == v.shape == (6,):
                samples = np.empty(12)
                samples[:6], samples[6:] = h, v
                return samples
        parts: list[Array] = []
        for wrench, slip in zip(wrenches, slips, strict=True):
            twist = slip.twist if slip.valid else NO_SLIP
            if wrench.wrench.shape != (6,) or twist.shape != (6,) or (self._slip_needed and not slip.valid):
                return None
            parts += (wrench.wrench, twist)
        return np.concatenate(parts)

    @_QUIET
    def _beyond_dead_band(self, twist: Array) -> Array:
        return measured_twist(self.params.measured, twist * self.contacts[0].slip_axes)

    def _pack(self, tuning: Tuning) -> tuple[Tuning, Array, Array]:
        """Return a tuning with its packed numbers; those of the last one are kept, because it seldom changes."""
        if self._packed is None or self._packed[0] is not tuning:
            numbers = pack_tuning(tuning.gains, tuning.object_model)
            self._packed = tuning, numbers, pack_contacts(moved_contacts(self.contacts, tuning))
        return self._packed

    def _tuning(self, state: ControllerState) -> Tuning:
        return self.tuning if state.ramp is None else tuning_at(state.ramp, state.stamp_ns)

    def _slowed(self, tuning: Tuning, delays: Delays) -> Tuning:
        """Return the tuning with the k_s that the delays allow that were measured, where it is free to be chosen."""
        if self.params.gains.k_s_mode == "fixed":
            return tuning
        latency, period, _ = delays
        if self._accepted[:2] != (latency, period):  # they seldom change
            limit = stable_slip_gain(delays, self._period_ns)
            self._accepted = latency, period, limit / self.params.gains.k_s_margin
        accepted = self._accepted[2]
        if accepted >= tuning.gains.k_s:
            return tuning
        base, slowed = self._slow_tuning
        if base is not tuning or slowed.gains.k_s != accepted:
            slowed = tuning._replace(gains=tuning.gains._replace(k_s=accepted))
            self._slow_tuning = tuning, slowed
        return slowed

    def _observe(
        self,
        state: ControllerState,
        observer: ObserverMemory,
        tuning: Tuning,
        stamp_ns: int,
        arm: ArmTerms,
        samples: Array,
        new_slips: tuple[SlipSample, ...],
    ) -> ObserverMemory | None:
        """Predict slip from the wrench and the motion of this tick, and correct it with the samples.

        An observer has a memory of its own, so bad numbers must not reach it: None where there are any.
        """
        assert self._observer is not None
        _, gains, contacts = self._pack(tuning)
        motion = np.empty(MOTION)
        if not predict_motion(arm.record, gains, contacts, samples, state.memory, observer.now, motion):
            return None
        return self._observer.observe(observer, stamp_ns, motion, new_slips)

    @_QUIET
    def _safe(self, state: ControllerState, joint: JointSample, reason: str) -> TickResult:
        """Hold the arm against gravity and brake its joints, from the last finite joint state."""
        size = state.position.shape
        q = joint.position if joint.position.shape == size and finite(joint.position) else state.position
        qd = joint.velocity if joint.velocity.shape == size and finite(joint.velocity) else None
        torque = safe_torque(self.arm.gravity(q), qd, self.params.safety.joint_damping)
        effort, saturated = limit_effort(torque, self.arm.effort_limit)
        following = state._replace(stamp_ns=max(joint.stamp_ns, state.stamp_ns), position=readonly(q))
        for array in (effort, saturated):
            array.setflags(write=False)
        record = TickDiagnostics("safe", reason, (), effort, saturated, None, None, None)
        return TickResult(EffortCommand(joint.stamp_ns, effort), following, record)
