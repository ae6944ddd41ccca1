"""From inputs and their worth to the effort that is published: modes, fallbacks, law or hold, walls, the last gate.

Pure like the law: the memory is a frozen value, time is an argument. Every command of the controller comes out of
`Supervisor.step` or `Supervisor.without_joint_state`, and both end in the gate.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_msgs_py.arrays import Array
from slip_msgs_py.types import CartesianReference, EffortCommand, JointSample, SlipSample, WrenchSample
from slip_vic_controller.core.controller import TickResult, VicController
from slip_vic_controller.core.diagnostics import Glance, TickDiagnostics
from slip_vic_controller.core.fallback import LadderPolicy, LadderState, Rung, descend
from slip_vic_controller.core.grasp import contact_arm, object_rotation
from slip_vic_controller.core.input_monitor import Health
from slip_vic_controller.core.load_monitor import (
    CANNOT_CARRY,
    EvidenceState,
    cannot_carry,
    fall_speed,
    make_load_policy,
    slip_evidence,
)
from slip_vic_controller.core.modes import (
    ASKED,
    Findings,
    Mode,
    ModePolicy,
    ModeState,
    Request,
    initial_mode,
    next_mode,
)
from slip_vic_controller.core.output_gate import GateLimits, GateState, needs_restart, pass_gate, start_gate
from slip_vic_controller.core.path_time import (
    FULL,
    PathTime,
    advance_path_time,
    lost_ns,
    moving,
    scale_for_error,
    scaled,
)
from slip_vic_controller.core.repulsion import joint_repulsion, make_walls, pad_brake, too_fast
from slip_vic_controller.core.rotation import cross
from slip_vic_controller.core.safety import hold_torque
from slip_vic_controller.core.state import ControllerState
from slip_vic_controller.core.trajectory import reference_at
from slip_vic_controller.core.trouble import Trouble, say

_EVIDENCE_NS = 50_000_000  # how long a contradiction must last
_FAST_NS = 5_000_000  # how long a speed must be too high: a single bad sample is no speed
_SLIPPING = 0.005  # [m/s] above which a slip velocity counts as slip, with the gate closed too
_STOPPED = PathTime(0.0, 0.0)


class SupervisorState(NamedTuple):
    """The memory of the supervision; (n,) arrays, None before there is anything to remember.

    mode; gate; ladder; path; posture: that HOLD keeps [rad]; now_ns: of the last cycle; joint_bad_since_ns;
    contradicted_since_ns, fast_since_ns, saturated_since_ns, stopping_since_ns; fall [m/s]; evidence; speed: of the
    path for the last errors, 0 to 1; moves: whether the last reference did.
    """

    mode: ModeState
    gate: GateState | None
    ladder: LadderState
    path: PathTime
    posture: Array | None
    now_ns: int
    joint_bad_since_ns: int | None
    contradicted_since_ns: int | None
    fast_since_ns: int | None
    saturated_since_ns: int | None
    stopping_since_ns: int | None
    fall: float
    evidence: EvidenceState | None
    speed: float
    moves: bool


class Supervised(NamedTuple):
    """One cycle: command, memories, the record of the tick, and which joints were at the rate limit (n,)."""

    command: EffortCommand
    control: ControllerState
    state: SupervisorState
    diagnostics: TickDiagnostics
    limited: NDArray[np.bool_]


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
        self._limits = GateLimits(
            controller.arm.effort_limit, limits.effort_rate, _ns(limits.longest_step_s), _ns(limits.restart_after_s)
        )
        self._walls = make_walls(controller.arm, limits)
        self._policy = ModePolicy(safety.auto_enable, safety.auto_resume, _ns(safety.resume_after_s))
        observer_s = safety.fallback.observer_s if params.slip_estimator == "observer" else 0.0
        self._ladder = LadderPolicy(_ns(observer_s), _ns(safety.fallback.slow_down_s))
        self._load = make_load_policy(np.array(params.gravity), safety.load.drop_speed, safety.load.memory_s)
        self._bridge_ns, self._gap_ns = _ns(inputs.bridge_s), _ns(inputs.joint.age_s)
        self._saturated_ns = _ns(safety.saturated_s)
        self._slip_needed = params.controller == "vic"

    def initial_state(self, now_ns: int) -> SupervisorState:
        """Return the memory before the first cycle."""
        mode = initial_mode(self._policy, now_ns)
        nothing = (None,) * 5
        return SupervisorState(mode, None, LadderState(), FULL, None, now_ns, *nothing, 0.0, None, 1.0, False)

    def waiting(self, state: SupervisorState, missing: str, request: Request, now_ns: int) -> SupervisorState:
        """Return the memory after a cycle that gives no effort, because of what is missing."""
        mode = next_mode(state.mode, Findings(missing=missing), request, now_ns, self._policy)
        return state._replace(mode=mode, gate=None, now_ns=now_ns)

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
        with np.errstate(all="ignore"):
            if health.joint not in (Trouble.NONE, Trouble.DENORMAL, Trouble.RESTARTED, Trouble.NOT_RUN):
                return self._blind(state, control, now_ns, joint, health.joint, request)
            return self._seeing(
                state._replace(joint_bad_since_ns=None), control, now_ns, joint, wrenches, slips, health, frozen,
                request, reference, new_slips,
            )  # fmt: skip

    def without_joint_state(
        self, state: SupervisorState, control: ControllerState, now_ns: int, request: Request
    ) -> Supervised:
        """Return what to do when joint states stay away: HOLD, efforts go to gravity compensation where the arm was."""
        findings = Findings(hold=say("joint state", Trouble.SILENT))
        mode = next_mode(state.mode, findings, request, now_ns, self._policy)
        state = state._replace(mode=mode, path=_STOPPED, posture=None)
        rest = np.zeros_like(control.position)
        joint = JointSample(control.stamp_ns, control.position, rest, rest)
        return self._finish(state, control, now_ns, joint, self.controller.arm.gravity(control.position), None, None)

    # -- one cycle ---------------------------------------------------------------------------------

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
        stand_in = JointSample(joint.stamp_ns, control.position, np.zeros_like(control.position), np.zeros(0))
        return self._finish(state, control, now_ns, stand_in, wanted, None, None)

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
        request, state = self._stop_first(state, request, now_ns)
        findings, rung, state = self._find(state, now_ns, joint, health, frozen)
        mode = next_mode(state.mode, findings, request, now_ns, self._policy)
        entered = state.mode.mode
        state = state._replace(mode=mode)
        if not mode.mode.follows:
            return self._hold(state, control, now_ns, joint)
        dt_ns = max(joint.stamp_ns - control.stamp_ns, 0)
        if not entered.follows:
            # After a HOLD the path starts from rest; and the time that passed in it is not part of the path.
            state = state._replace(
                path=FULL if entered == Mode.WAITING_INPUT else _STOPPED, posture=None, evidence=None, speed=1.0
            )
            control = self.controller.resume(control, joint)
        stops = rung == Rung.SLOWING or state.stopping_since_ns is not None
        wanted_scale = 0.0 if stops else state.speed
        path = advance_path_time(state.path, wanted_scale, dt_ns * 1e-9, self._safety.fallback.slow_down_s)
        control = control._replace(start_ns=control.start_ns + lost_ns(path, dt_ns))
        if path != FULL:
            reference = scaled(self._planned(control, joint, reference), path)
        if rung in (Rung.OBSERVED, Rung.SLOWING):
            slips = tuple(SlipSample(joint.stamp_ns, np.zeros(6)) for _ in slips)
            new_slips = ()  # an observer goes on with the model alone
        result = self.controller.step(control, joint, wrenches, slips, reference, new_slips)
        if result.diagnostics.status != "ok":
            # The law could not be evaluated: its own safe command for this tick, and HOLD.
            mode = next_mode(mode, Findings(hold=result.diagnostics.reason), Request.NONE, now_ns, self._policy)
            state = state._replace(mode=mode, path=_STOPPED, posture=joint.position)
            return self._finish(state, result.state, now_ns, joint, result.command.effort, None, None)
        state = self._watch(state._replace(path=path), result, now_ns, dt_ns * 1e-9)
        return self._finish(
            state, result.state, now_ns, joint, result.command.effort, result, result.diagnostics.glance
        )

    def _stop_first(self, state: SupervisorState, request: Request, now_ns: int) -> tuple[Request, SupervisorState]:
        """Let a user's HOLD begin when the path has come to rest: a sudden stop throws a weakly gripped object."""
        since = state.stopping_since_ns
        if request in (Request.ENABLE, Request.RESET_FAULT) or not state.mode.mode.follows:
            return request, state._replace(stopping_since_ns=None)
        if request == Request.HOLD and since is None:
            return Request.NONE, state._replace(stopping_since_ns=now_ns)
        if since is not None and now_ns - since >= 2 * self._ladder.slow_down_ns:
            return Request.HOLD, state._replace(stopping_since_ns=None)
        return Request.NONE, state

    def _find(
        self, state: SupervisorState, now_ns: int, joint: JointSample, health: Health, frozen: bool
    ) -> tuple[Findings, Rung, SupervisorState]:
        """Collect what speaks against the law."""
        slip = health.slip
        contradicted = state.contradicted_since_ns
        if slip == Trouble.NONE and contradicted is not None and now_ns - contradicted > _EVIDENCE_NS:
            slip = Trouble.IMPLAUSIBLE
        unknown = say("slip velocity", slip) if self._slip_needed and slip not in _FINE else ""
        ladder, rung, words = descend(state.ladder, unknown, now_ns, self._ladder)
        twist = None if state.evidence is None else state.evidence.twist
        fast = too_fast(self._walls, self.controller.joint_names, joint.velocity, twist)
        fast_since = None if not fast else now_ns if state.fast_since_ns is None else state.fast_since_ns
        state = state._replace(fast_since_ns=fast_since)
        fault = fast if fast_since is not None and now_ns - fast_since > _FAST_NS else ""
        fault = fault or cannot_carry(self._load, state.fall)
        hold = degraded = ""
        if health.outside == Trouble.FOREIGN_COMMAND:
            fault = fault or say("effort command", health.outside)
        elif health.outside != Trouble.NONE:
            hold = say("an input", health.outside)
        elif health.wrench not in _FINE:
            hold = say("wrench", health.wrench)
        elif now_ns - state.now_ns > self._gap_ns and state.mode.mode != Mode.WAITING_INPUT:
            hold = say("joint state", Trouble.NOT_RUN)
        elif frozen and state.moves and state.mode.mode.follows:
            hold = say("joint state", Trouble.FROZEN)
        elif rung == Rung.HOLD:
            hold = words
        elif words:
            degraded = words
        elif state.stopping_since_ns is not None:
            degraded = f"{ASKED}: comes to rest first"
        elif state.saturated_since_ns is not None and now_ns - state.saturated_since_ns > self._saturated_ns:
            degraded = "saturated: slip cannot be driven to zero"
        elif state.speed < 1.0 or state.path.scale < 1.0:
            degraded = "the path waits for the arm"
        return Findings("", fault, hold, degraded), rung, state._replace(ladder=ladder)

    def _planned(
        self, control: ControllerState, joint: JointSample, reference: CartesianReference | None
    ) -> CartesianReference:
        """Return the reference at the present time of the path."""
        if reference is not None:
            return reference
        t = (joint.stamp_ns - control.start_ns) * 1e-9 - self.controller.params.trajectory.start_s
        return reference_at(self.controller.path, t, control.start_position, control.start_rotation)

    def _watch(self, state: SupervisorState, result: TickResult, now_ns: int, dt: float) -> SupervisorState:
        """Look at what the law saw: errors, fall, and whether slip and wrench agree; for the next cycle."""
        glance = result.diagnostics.glance
        if glance is None:
            return state
        limits, law, reference = self._safety.limits, glance.law, glance.reference
        speed = scale_for_error(law.error_linear, law.error_angular, limits.error_linear, limits.error_angular)
        R = glance.arm.rotation
        plane = (R * self.controller.contacts[0].slip_axes[:3]).dot(R.T)
        v = law.slip_speed
        slipping = 1.0 if v > _SLIPPING else law.gate
        fall = fall_speed(self._load, state.fall, law.object_acceleration, reference[18:], plane, slipping, dt)
        evidence = slip_evidence(state.evidence, glance.arm.twist, law.carried, plane, dt)
        shown = math.sqrt(evidence.velocity.dot(evidence.velocity))
        blind = shown > self._safety.fallback.evidence and v < 0.1 * self._safety.fallback.evidence
        since = state.contradicted_since_ns
        return state._replace(
            fall=fall,
            evidence=evidence,
            speed=speed,
            moves=moving(reference[12:18]),
            contradicted_since_ns=None if not blind else now_ns if since is None else since,
        )

    def _hold(self, state: SupervisorState, control: ControllerState, now_ns: int, joint: JointSample) -> Supervised:
        """Keep the posture in which HOLD began."""
        posture = joint.position if state.posture is None else state.posture
        arm = self.controller.arm.terms(joint.position, joint.velocity)
        wanted = hold_torque(
            self.controller.arm.gravity(joint.position), arm.M, joint.position, joint.velocity, posture,
            self._safety.hold_stiffness, self._safety.hold_damping,
        )  # fmt: skip
        if not state.mode.reason.startswith(CANNOT_CARRY):
            wanted = wanted - arm.J.T.dot(self._load_wrench(control, arm.rotation))
        dt_ns = max(joint.stamp_ns - control.stamp_ns, 0)
        control = control._replace(
            stamp_ns=max(joint.stamp_ns, control.stamp_ns), start_ns=control.start_ns + dt_ns, position=joint.position
        )
        state = state._replace(
            posture=posture, path=_STOPPED, evidence=None, contradicted_since_ns=None, saturated_since_ns=None,
            fall=0.0, moves=False,
        )  # fmt: skip
        return self._finish(state, control, now_ns, joint, wanted, None, None)

    def _load_wrench(self, control: ControllerState, R_ee: Array) -> Array:
        """Return the wrench of a resting object on the pad from what is known of it; (6,) [N, N m] {w}.

        Not the measured one: HOLD must not depend on the inputs that may have caused it. Without it the wrist sags, the
        pads tilt, and a weakly gripped object slides off.
        """
        contact, model = self.controller.contacts[0], self.controller.object_model
        R_o = object_rotation(R_ee, contact, control.slips[0])
        weight = model.mass / len(self.controller.contacts) * model.gravity
        return np.concatenate((weight, -cross(contact_arm(R_o, contact, control.slips[0]), weight)))

    def _finish(
        self,
        state: SupervisorState,
        control: ControllerState,
        now_ns: int,
        joint: JointSample,
        wanted: Array,
        result: TickResult | None,
        glance: Glance | None,
    ) -> Supervised:
        """Add the walls, pass the gate, and write the record; every command comes through here."""
        torque = wanted
        push = joint_repulsion(self._walls, joint.position, joint.velocity)
        if push is not None:
            torque = torque + push
        if glance is not None:
            brake = pad_brake(self._walls, glance.arm.J, glance.arm.twist)
            if brake is not None:
                torque = torque + brake
        gate = state.gate
        if gate is None or needs_restart(self._limits, gate, now_ns):
            start = start_gate(self._limits, joint.effort, self.controller.arm.gravity(control.position), now_ns)
            # The first step counts one control period.
            gate = start._replace(now_ns=now_ns - _ns(self.controller.params.control_period_s))
        out = pass_gate(self._limits, gate, torque, now_ns)
        saturated = out.clipped | out.limited
        if result is not None:
            saturated = saturated | result.diagnostics.saturated
        since = state.saturated_since_ns
        following = state._replace(
            gate=out.state,
            now_ns=now_ns,
            saturated_since_ns=None if not np.count_nonzero(saturated) else now_ns if since is None else since,
        )
        mode = following.mode
        near = result.diagnostics.near_singular if result is not None else ()
        if result is not None and not out.refused:
            evaluate = result.diagnostics.evaluate
            record = TickDiagnostics("ok", mode.reason, near, out.effort, saturated, glance, evaluate)
        else:
            record = TickDiagnostics("safe", mode.reason or "bridged", near, out.effort, saturated, None, None)
        saturated.flags.writeable = False
        return Supervised(EffortCommand(joint.stamp_ns, out.effort), control, following, record, out.limited)


_FINE = (Trouble.NONE, Trouble.DENORMAL)


def _ns(seconds: float) -> int:
    return round(seconds * 1e9)
