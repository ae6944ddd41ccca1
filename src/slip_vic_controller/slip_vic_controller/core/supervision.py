"""From inputs and their worth to the effort that is published: modes, fallbacks, law or hold, walls, the last gate.

Pure like the law: the memory is a frozen value, time is an argument. Every command of the controller comes out of
`Supervisor.step` or `Supervisor.without_joint_state`, and both end in the gate.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from slip_core.arrays import Array, readonly
from slip_core.stamps import seconds_to_ns
from slip_core.types import CartesianReference, EffortCommand, JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.controller import TickResult, VicController
from slip_vic_controller.core.diagnostics import TickDiagnostics
from slip_vic_controller.core.fallback import LadderState, Rung
from slip_vic_controller.core.findings import FINE, Examiner
from slip_vic_controller.core.guard_kernel import WATCHED, guard, watch
from slip_vic_controller.core.holder import Holder
from slip_vic_controller.core.input_monitor import Health
from slip_vic_controller.core.lateness import Lateness, answered
from slip_vic_controller.core.load_monitor import CANNOT_CARRY
from slip_vic_controller.core.modes import (
    Findings,
    Mode,
    ModePolicy,
    Request,
    initial_mode,
    next_mode,
)
from slip_vic_controller.core.output_gate import GateLimits, GateState, largest_step, needs_restart, start_gate
from slip_vic_controller.core.path_time import FULL, PathTime, advance_path_time, lost_ns, scaled
from slip_vic_controller.core.state import ControllerState
from slip_vic_controller.core.supervisor_state import NO_ERROR, UNWATCHED, Supervised, SupervisorState
from slip_vic_controller.core.trajectory import reference_at
from slip_vic_controller.core.trouble import Trouble, say

_SLIPPING = 0.005  # [m/s] above which a slip velocity counts as slip, with the gate closed too
_STOPPED = PathTime(0.0, 0.0)


class Supervisor:
    """Decides in every cycle what the arm does. Holds configuration only.

    Args:
        controller: the law.
    """

    def __init__(self, controller: VicController) -> None:
        self.controller = controller
        params = controller.params
        safety = params.safety
        limits, inputs = safety.limits, safety.inputs
        self._safety = safety
        self._holder = Holder(controller)
        self._limits = GateLimits(
            controller.arm.effort_limit,
            limits.effort_rate,
            seconds_to_ns(limits.longest_step_s),
            seconds_to_ns(limits.restart_after_s),
        )
        self._examiner = Examiner(controller)
        self._unlimited = controller.unsaturated
        self._policy = ModePolicy(safety.auto_enable, safety.auto_resume, seconds_to_ns(safety.resume_after_s))
        self._bridge_ns, self._late_ns = seconds_to_ns(inputs.bridge_s), seconds_to_ns(inputs.joint.late_s)
        load = self._examiner.load
        axes = controller.contacts[0].slip_axes[:3]
        bounds = (limits.error_linear, limits.error_angular, _SLIPPING)
        self._watching = readonly((*load.down, load.memory_s, *bounds, *axes))

    def initial_state(self, now_ns: int) -> SupervisorState:
        """Return the memory before the first cycle."""
        mode = initial_mode(self._policy, now_ns)
        nothing = (None,) * 5
        return SupervisorState(mode, None, LadderState(), FULL, None, now_ns, *nothing, UNWATCHED, NO_ERROR, Lateness())

    def waiting(self, state: SupervisorState, missing: str, request: Request, now_ns: int) -> SupervisorState:
        """Return the memory after a cycle that gives no effort, because of what is missing."""
        mode = next_mode(state.mode, Findings(missing=missing), request, now_ns, self._policy)
        # Without effort the arm goes anywhere: HOLD, also that of a fault, begins anew where it is then.
        return state._replace(mode=mode, gate=None, now_ns=now_ns, posture=None, lateness=Lateness())

    def step(
        self,
        state: SupervisorState,
        control: ControllerState,
        now_ns: int,
        joint: JointSample,
        wrenches: tuple[WrenchSample, ...],
        slips: tuple[SlipSample, ...],
        health: Health,
        frozen: bool,
        request: Request,
        reference: CartesianReference | None,
        new_slips: tuple[SlipSample, ...] | None = None,
    ) -> Supervised:
        """Answer one joint state; never raises.

        Args:
            state: memory of the supervision.
            control: memory of the law.
            now_ns: steady time, in lockstep the joint state's stamp.
            joint, wrenches, slips: the newest samples.
            health: what they are worth.
            frozen: whether the joint values have been equal to the last bit for long.
            request: what a user asked for.
            reference: from a topic, or None.
            new_slips: of the own contact, all since the last cycle; None = the newest.
        """
        if health.joint not in _ANSWERED:
            return self._blind(state, control, now_ns, joint, health.joint, request)
        if state.joint_bad_since_ns is not None:
            state = state._replace(joint_bad_since_ns=None)
        late = state.lateness
        if request == Request.ENABLE:
            late = Lateness()  # whoever asks for the law has seen to it that a clock was set, and nothing is late
        late = answered(late, now_ns, joint.stamp_ns, now_ns - state.now_ns, self._late_ns)
        state = state._replace(lateness=late)
        request, state = self._stop_first(state, request, now_ns)
        findings, rung, state = self._examiner.find(state, now_ns, joint, slips, health, frozen)
        mode = next_mode(state.mode, findings, request, now_ns, self._policy)
        entered = state.mode.mode
        if mode is not state.mode:
            state = state._replace(mode=mode)
        if not mode.mode.follows:
            measured = wrenches[0].wrench if health.wrench in FINE and not frozen else None
            return self._hold(state, control, now_ns, joint, measured)
        if not entered.follows:
            # After a HOLD the path starts from rest; and the time that passed in it is not part of the path.
            state = state._replace(
                path=FULL if entered == Mode.WAITING_INPUT else _STOPPED, posture=None, watched=UNWATCHED
            )
            control = self.controller.resume(control, joint)
        return self._follow(state, control, now_ns, joint, wrenches, slips, rung, reference, new_slips)

    @np.errstate(all="ignore")  # what is not finite is looked for by value
    def without_joint_state(
        self, state: SupervisorState, control: ControllerState, now_ns: int, request: Request
    ) -> Supervised:
        """Return what to do when joint states stay away: HOLD, efforts go to gravity compensation where the arm was."""
        findings = Findings(hold=say("joint state", Trouble.SILENT))
        mode = next_mode(state.mode, findings, request, now_ns, self._policy)
        state = state._replace(mode=mode, path=_STOPPED, posture=None)
        rest = np.zeros_like(control.position)
        joint = JointSample(control.stamp_ns, control.position, rest, rest)
        return self._finish(state, control, now_ns, joint, self.controller.arm.gravity(control.position), None)

    # -- one cycle ---------------------------------------------------------------------------------

    @np.errstate(all="ignore")  # what is not finite is looked for by value
    def _blind(
        self, state: SupervisorState, control: ControllerState, now_ns: int, joint: JointSample, trouble: Trouble,
        request: Request,
    ) -> Supervised:  # fmt: skip
        """Bridge a short gap of good joint states with the last effort, then let it go to gravity compensation."""
        since = now_ns if state.joint_bad_since_ns is None else state.joint_bad_since_ns
        # After a pause the last effort is old, however young the bad sample.
        ran = now_ns - state.now_ns <= self._examiner.gap_ns
        bridged = ran and state.gate is not None and now_ns - since <= self._bridge_ns
        mode = state.mode
        wanted = self.controller.arm.gravity(control.position)
        if bridged and state.gate is not None:
            wanted = state.gate.effort
        else:
            findings = Findings(hold=say("joint state", trouble))
            mode = next_mode(mode, findings, request, now_ns, self._policy)
            state = state._replace(path=_STOPPED, posture=None)
        state = state._replace(mode=mode, joint_bad_since_ns=since)
        # After a pause the gate starts at what the joints feel; a jump of the positions leaves the efforts believable.
        felt = joint.effort if trouble == Trouble.JUMP else np.zeros(0)
        stand_in = JointSample(joint.stamp_ns, control.position, np.zeros_like(control.position), felt)
        return self._finish(state, control, now_ns, stand_in, wanted, None)

    def _follow(
        self, state: SupervisorState, control: ControllerState, now_ns: int, joint: JointSample,
        wrenches: tuple[WrenchSample, ...], slips: tuple[SlipSample, ...], rung: Rung,
        reference: CartesianReference | None, new_slips: tuple[SlipSample, ...] | None,
    ) -> Supervised:  # fmt: skip
        """Let the law work, along the path as fast as errors and the slip ladder allow."""
        dt_ns = max(joint.stamp_ns - control.stamp_ns, 0)
        stops = rung == Rung.SLOWING or state.stopping_since_ns is not None
        wanted_scale = 0.0 if stops else float(state.watched[1])
        path = FULL
        if wanted_scale < 1.0 or state.path != FULL:
            path = advance_path_time(state.path, wanted_scale, dt_ns * 1e-9, self._safety.fallback.slow_down_s)
        if path != FULL:
            control = control._replace(start_ns=control.start_ns + lost_ns(path, dt_ns))
            reference = scaled(self._planned(control, joint, reference), path)
        if rung in (Rung.OBSERVED, Rung.SLOWING):
            slips = tuple(SlipSample(joint.stamp_ns, np.zeros(6)) for _ in slips)
            new_slips = ()  # an observer goes on with the model alone
        result = self.controller.step(control, joint, wrenches, slips, reference, new_slips)
        if result.diagnostics.status != "ok":
            # The law could not be evaluated: its own safe command for this tick, and HOLD.
            findings = Findings(hold=result.diagnostics.reason)
            mode = next_mode(state.mode, findings, Request.NONE, now_ns, self._policy)
            state = state._replace(mode=mode, path=_STOPPED, posture=joint.position)
            return self._finish(state, result.state, now_ns, joint, result.command.effort, None)
        watched, contradicted_since_ns = self._watch(state, result, now_ns, dt_ns * 1e-9)
        return self._finish(
            state, result.state, now_ns, joint, result.command.effort, result, path=path, watched=watched,
            contradicted_since_ns=contradicted_since_ns,
        )  # fmt: skip

    def _stop_first(self, state: SupervisorState, request: Request, now_ns: int) -> tuple[Request, SupervisorState]:
        """Let a user's HOLD begin when the path has come to rest: a sudden stop throws a weakly gripped object."""
        since = state.stopping_since_ns
        if request in (Request.ENABLE, Request.RESET_FAULT) or not state.mode.mode.follows:
            return request, state if since is None else state._replace(stopping_since_ns=None)
        if request == Request.HOLD and since is None:
            return Request.NONE, state._replace(stopping_since_ns=now_ns)
        if since is not None and now_ns - since >= 2 * self._examiner.ladder.slow_down_ns:
            return Request.HOLD, state._replace(stopping_since_ns=None)
        return Request.NONE, state

    def _planned(
        self, control: ControllerState, joint: JointSample, reference: CartesianReference | None
    ) -> CartesianReference:
        """Return the reference at the present time of the path."""
        if reference is not None:
            return reference
        t = (joint.stamp_ns - control.start_ns) * 1e-9 - self.controller.params.trajectory.start_s
        return reference_at(self.controller.path, t, control.start_position, control.start_rotation)

    def _watch(self, state: SupervisorState, result: TickResult, now_ns: int, dt: float) -> tuple[Array, int | None]:
        """Look at what the law saw: errors, fall, and whether slip and wrench agree; for the next cycle."""
        glance = result.diagnostics.glance
        assert glance is not None
        packed, before = np.empty(WATCHED), state.watched
        watch(
            glance.arm.record, glance.law.packed, glance.reference, self._watching, before, dt, packed
        )  # fmt: skip
        packed.setflags(write=False)
        evidence = self._safety.fallback.evidence
        blind = packed[3] > evidence and glance.law.slip_speed < 0.1 * evidence
        since = state.contradicted_since_ns
        return packed, None if not blind else now_ns if since is None else since

    @np.errstate(all="ignore")
    def _hold(
        self, state: SupervisorState, control: ControllerState, now_ns: int, joint: JointSample, measured: Array | None
    ) -> Supervised:
        """Keep the posture in which HOLD began; `measured` is the wrench on the own pad, None where it is not good."""
        paused = now_ns - state.now_ns > self._examiner.gap_ns  # somebody else held the arm meanwhile
        anew = state.posture is None or paused
        posture = joint.position if anew or state.posture is None else state.posture
        error = NO_ERROR if anew else state.load_error
        dt_ns = max(joint.stamp_ns - control.stamp_ns, 0)
        carries = not state.mode.reason.startswith(CANNOT_CARRY)
        late_s = state.lateness.most_ns * 1e-9
        wanted, error = self._holder.effort(
            joint, control.slips[0], posture, error, measured, dt_ns * 1e-9, late_s, carries=carries
        )
        control = control._replace(
            stamp_ns=max(joint.stamp_ns, control.stamp_ns), start_ns=control.start_ns + dt_ns, position=joint.position
        )
        state = state._replace(
            posture=posture, path=_STOPPED, watched=UNWATCHED, contradicted_since_ns=None, saturated_since_ns=None,
            load_error=error,
        )  # fmt: skip
        return self._finish(state, control, now_ns, joint, wanted, None)

    def _finish(
        self,
        state: SupervisorState,
        control: ControllerState,
        now_ns: int,
        joint: JointSample,
        wanted: Array,
        result: TickResult | None,
        **changes: Any,
    ) -> Supervised:
        """Add the walls, pass the gate, and write the record; every command comes through here."""
        limits, gate, n = self._limits, state.gate, self._unlimited.size
        if gate is None or needs_restart(limits, gate, now_ns):
            start = start_gate(limits, joint.effort, self.controller.arm.gravity(control.position), now_ns)
            # The first step counts one control period.
            gate = start._replace(now_ns=now_ns - seconds_to_ns(self.controller.params.control_period_s))
        law = None if result is None else result.diagnostics
        arm = None if law is None or law.glance is None else law.glance.arm
        out = np.empty(3 * n + 3)
        walls, speeds = self._examiner.walls, self._examiner.speeds
        guard(
            joint.position, joint.velocity, wanted if arm is None else arm.record, arm is not None,
            wanted if wanted.shape == (n,) else np.full(n, np.nan), walls, speeds, gate.effort,
            largest_step(limits, gate, now_ns), out,
        )  # fmt: skip
        out.setflags(write=False)
        effort, limited = out[:n], out[2 * n : 3 * n] > 0.0 if out[-1] else self._unlimited
        saturated = self._unlimited if law is None else law.saturated
        if out[-2]:
            saturated = saturated | (out[n : 2 * n] > 0.0)
            saturated.setflags(write=False)
        since = None
        if saturated is not self._unlimited and saturated.any():
            since = now_ns if state.saturated_since_ns is None else state.saturated_since_ns
        gate = GateState(effort, max(now_ns, gate.now_ns))
        following = state._replace(gate=gate, now_ns=now_ns, saturated_since_ns=since, **changes)
        reason = state.mode.reason
        if law is not None and out[-3] == 0.0:
            record = TickDiagnostics(
                "ok", reason, law.near_singular, effort, saturated, law.glance, law.evaluate, law.describe
            )
        else:
            near = () if law is None else law.near_singular
            record = TickDiagnostics("safe", reason or "bridged", near, effort, saturated, None, None, None)
        return Supervised(EffortCommand(joint.stamp_ns, effort), control, following, record, limited)


_ANSWERED = (Trouble.NONE, Trouble.DENORMAL, Trouble.RESTARTED, Trouble.NOT_RUN)
