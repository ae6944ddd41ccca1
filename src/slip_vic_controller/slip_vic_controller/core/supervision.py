"""From inputs and their worth to the effort that is published: modes, fallbacks, law or hold, walls, the last gate.

Pure like the law: the memory is a frozen value, time is an argument. Every command of the controller comes out of
`Supervisor.step` or `Supervisor.without_joint_state`, and both end in the gate.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from slip_msgs_py.arrays import Array, readonly
from slip_msgs_py.types import CartesianReference, EffortCommand, JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.controller import TickResult, VicController
from slip_vic_controller.core.diagnostics import TickDiagnostics
from slip_vic_controller.core.fallback import LadderPolicy, LadderState, Rung, descend
from slip_vic_controller.core.guard_kernel import WATCHED, guard, too_fast_index, watch
from slip_vic_controller.core.holder import Holder
from slip_vic_controller.core.input_monitor import Health
from slip_vic_controller.core.lateness import Lateness, answered
from slip_vic_controller.core.load_monitor import CANNOT_CARRY, cannot_carry, make_load_policy
from slip_vic_controller.core.modes import (
    ASKED,
    Findings,
    Mode,
    ModePolicy,
    Request,
    initial_mode,
    next_mode,
)
from slip_vic_controller.core.output_gate import GateLimits, GateState, largest_step, needs_restart, start_gate
from slip_vic_controller.core.path_time import FULL, PathTime, advance_path_time, lost_ns, scaled
from slip_vic_controller.core.repulsion import TRIP, make_walls, pack_walls, too_fast
from slip_vic_controller.core.state import ControllerState
from slip_vic_controller.core.supervisor_state import NO_ERROR, UNWATCHED, Supervised, SupervisorState
from slip_vic_controller.core.trajectory import reference_at
from slip_vic_controller.core.trouble import Trouble, say

_EVIDENCE_NS = 50_000_000  # how long a contradiction must last
_FAST_NS = 5_000_000  # how long a speed must be too high: a single bad sample is no speed
_SLIPPING = 0.005  # [m/s] above which a slip velocity counts as slip, with the gate closed too
_STOPPED = PathTime(0.0, 0.0)
SLIDES = "the object slides: it comes to rest first"


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
            controller.arm.effort_limit, limits.effort_rate, _ns(limits.longest_step_s), _ns(limits.restart_after_s)
        )
        self._walls = make_walls(controller.arm, limits)
        self._packed_walls, self._speeds = pack_walls(self._walls)
        self._unlimited = controller.unsaturated
        self._policy = ModePolicy(safety.auto_enable, safety.auto_resume, _ns(safety.resume_after_s))
        observer_s = safety.fallback.observer_s if params.slip_estimator == "observer" else 0.0
        self._ladder = LadderPolicy(_ns(observer_s), _ns(safety.fallback.slow_down_s))
        self._load = make_load_policy(np.array(params.gravity), safety.load.drop_speed, safety.load.memory_s)
        self._bridge_ns, self._gap_ns = _ns(inputs.bridge_s), _ns(inputs.joint.age_s)
        self._late_ns, self._late_after = _ns(inputs.joint.late_s), inputs.accept_after
        self._saturated_ns = _ns(safety.saturated_s)
        self._slip_needed = params.controller == "vic"
        axes = controller.contacts[0].slip_axes[:3]
        bounds = (limits.error_linear, limits.error_angular, _SLIPPING)
        self._watching = readonly((*self._load.down, self._load.memory_s, *bounds, *axes))

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
        return self._seeing(
            state, control, now_ns, joint, wrenches, slips, health, frozen, request, reference, new_slips
        )

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
        bridged = state.gate is not None and now_ns - since <= self._bridge_ns
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

    def _seeing(
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
        late = state.lateness
        if request == Request.ENABLE:
            late = Lateness()  # whoever asks for the law has seen to it that a clock was set, and nothing is late
        late = answered(late, now_ns, joint.stamp_ns, now_ns - state.now_ns, self._late_ns)
        state = state._replace(lateness=late)
        request, state = self._stop_first(state, request, now_ns)
        findings, rung, state = self._find(state, now_ns, joint, slips, health, frozen)
        mode = next_mode(state.mode, findings, request, now_ns, self._policy)
        entered = state.mode.mode
        if mode is not state.mode:
            state = state._replace(mode=mode)
        if not mode.mode.follows:
            measured = wrenches[0].wrench if health.wrench in _FINE and not frozen else None
            return self._hold(state, control, now_ns, joint, measured)
        dt_ns = max(joint.stamp_ns - control.stamp_ns, 0)
        if not entered.follows:
            # After a HOLD the path starts from rest; and the time that passed in it is not part of the path.
            state = state._replace(
                path=FULL if entered == Mode.WAITING_INPUT else _STOPPED, posture=None, watched=UNWATCHED
            )
            control = self.controller.resume(control, joint)
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
            mode = next_mode(mode, Findings(hold=result.diagnostics.reason), Request.NONE, now_ns, self._policy)
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
        if since is not None and now_ns - since >= 2 * self._ladder.slow_down_ns:
            return Request.HOLD, state._replace(stopping_since_ns=None)
        return Request.NONE, state

    def _find(
        self,
        state: SupervisorState,
        now_ns: int,
        joint: JointSample,
        slips: tuple[SlipSample, ...],
        health: Health,
        frozen: bool,
    ) -> tuple[Findings, Rung, SupervisorState]:
        """Collect what speaks against the law."""
        slip = health.slip
        contradicted = state.contradicted_since_ns
        if slip == Trouble.NONE and contradicted is not None and now_ns - contradicted > _EVIDENCE_NS:
            slip = Trouble.IMPLAUSIBLE
        rung, words, unknown = Rung.MEASURED, "", ""
        if (slip not in _FINE and self._slip_needed) or state.ladder.since_ns is not None:
            unknown = say("slip velocity", slip) if self._slip_needed and slip not in _FINE else ""
            ladder, rung, words = descend(state.ladder, unknown, now_ns, self._ladder)
            state = state._replace(ladder=ladder)
        fault, watched = "", state.watched
        fastest = too_fast_index(joint.velocity, self._packed_walls, self._speeds, watched, TRIP)
        if fastest >= 0 or state.fast_since_ns is not None:
            since = None if fastest < 0 else now_ns if state.fast_since_ns is None else state.fast_since_ns
            state = state._replace(fast_since_ns=since)
            if since is not None and now_ns - since > _FAST_NS:
                fault = too_fast(self._walls, self.controller.joint_names, joint.velocity, watched[7:13])
        if watched[0] > self._load.drop_speed:
            fault = fault or cannot_carry(self._load, float(watched[0]))
        hold = degraded = ""
        if health.outside == Trouble.FOREIGN_COMMAND:
            fault = fault or say("effort command", health.outside)
        elif health.outside != Trouble.NONE:
            hold = say("an input", health.outside)
        elif health.wrench not in _FINE:
            hold = say("wrench", health.wrench)
        elif now_ns - state.now_ns > self._gap_ns and state.mode.mode != Mode.WAITING_INPUT:
            hold = say("joint state", Trouble.NOT_RUN)
        elif state.lateness.in_a_row >= self._late_after:
            hold = say("joint state", Trouble.LATE)
        elif frozen and watched[2] and state.mode.mode.follows:
            hold = say("joint state", Trouble.FROZEN)
        elif rung == Rung.HOLD:
            hold = words
        elif unknown and not state.mode.mode.follows:
            hold = unknown  # the ladder is for a law that is at work
        elif not state.mode.mode.follows and self._slip_needed and self._slides(slips):
            # With the delay of its loop the law would swing instead of catching what already slides fast.
            hold = SLIDES
        elif words:
            degraded = words
        elif state.stopping_since_ns is not None:
            degraded = f"{ASKED}: comes to rest first"
        elif state.saturated_since_ns is not None and now_ns - state.saturated_since_ns > self._saturated_ns:
            degraded = "saturated: slip cannot be driven to zero"
        elif watched[1] < 1.0 or state.path.scale < 1.0:
            degraded = "the path waits for the arm"
        if not (fault or hold or degraded):
            return _NOTHING, rung, state
        return Findings("", fault, hold, degraded), rung, state

    def _slides(self, slips: tuple[SlipSample, ...]) -> bool:
        """Return whether an object slides too fast for the law to begin."""
        linear, angular = self._safety.resume_slip_linear, self._safety.resume_slip_angular
        return any(
            linear * linear < v[:3].dot(v[:3]) or angular * angular < v[3:].dot(v[3:]) for v in (s.twist for s in slips)
        )

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
        packed.flags.writeable = False
        evidence = self._safety.fallback.evidence
        blind = packed[3] > evidence and glance.law.slip_speed < 0.1 * evidence
        since = state.contradicted_since_ns
        return packed, None if not blind else now_ns if since is None else since

    @np.errstate(all="ignore")
    def _hold(
        self, state: SupervisorState, control: ControllerState, now_ns: int, joint: JointSample, measured: Array | None
    ) -> Supervised:
        """Keep the posture in which HOLD began; `measured` is the wrench on the own pad, None where it is not good."""
        paused = now_ns - state.now_ns > self._gap_ns  # somebody else held the arm meanwhile
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
            gate = start._replace(now_ns=now_ns - _ns(self.controller.params.control_period_s))
        law = None if result is None else result.diagnostics
        arm = None if law is None or law.glance is None else law.glance.arm
        out = np.empty(3 * n + 3)
        guard(
            joint.position, joint.velocity, wanted if arm is None else arm.record, arm is not None,
            wanted if wanted.shape == (n,) else np.full(n, np.nan), self._packed_walls, self._speeds, gate.effort,
            largest_step(limits, gate, now_ns), out,
        )  # fmt: skip
        out.flags.writeable = False
        effort, limited = out[:n], out[2 * n : 3 * n] > 0.0 if out[-1] else self._unlimited
        saturated = self._unlimited if law is None else law.saturated
        if out[-2]:
            saturated = saturated | (out[n : 2 * n] > 0.0)
            saturated.flags.writeable = False
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


_NOTHING = Findings()
_FINE = (Trouble.NONE, Trouble.DENORMAL)
_ANSWERED = (Trouble.NONE, Trouble.DENORMAL, Trouble.RESTARTED, Trouble.NOT_RUN)


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)
