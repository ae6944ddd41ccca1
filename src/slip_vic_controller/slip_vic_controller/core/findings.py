"""Everything that speaks against the law in a cycle: faults, reasons to hold, reasons to be careful.

Pure: the memory is a frozen value, time is an argument.
"""

from __future__ import annotations

import numpy as np

from slip_core.stamps import seconds_to_ns
from slip_core.types import JointSample, SlipSample
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.fallback import LadderPolicy, Rung, descend
from slip_vic_controller.core.guard_kernel import too_fast_index
from slip_vic_controller.core.input_monitor import Health
from slip_vic_controller.core.load_monitor import cannot_carry, make_load_policy
from slip_vic_controller.core.modes import ASKED, Findings, Mode
from slip_vic_controller.core.repulsion import TRIP, make_walls, pack_walls, too_fast
from slip_vic_controller.core.supervisor_state import SupervisorState
from slip_vic_controller.core.trouble import Trouble, say

FINE = (Trouble.NONE, Trouble.DENORMAL)
SLIDES = "the object slides: it comes to rest first"
_EVIDENCE_NS = 50_000_000  # how long a contradiction must last
_FAST_NS = 5_000_000  # how long a speed must be too high: a single bad sample is no speed
_NOTHING = Findings()


class Examiner:
    """Looks in every cycle for what speaks against the law. Holds configuration only.

    Args:
        controller: the law.
    """

    def __init__(self, controller: VicController) -> None:
        params, safety = controller.params, controller.params.safety
        inputs, fallback = safety.inputs, safety.fallback
        self._joint_names = controller.joint_names
        self._limits = make_walls(controller.arm, safety.limits)
        self.walls, self.speeds = pack_walls(self._limits)
        observer_s = fallback.observer_s if params.slip_estimator == "observer" else 0.0
        self.ladder = LadderPolicy(seconds_to_ns(observer_s), seconds_to_ns(fallback.slow_down_s))
        self.load = make_load_policy(np.array(params.gravity), safety.load.drop_speed, safety.load.memory_s)
        self.gap_ns, self._late_after = seconds_to_ns(inputs.joint.age_s), inputs.accept_after
        self._saturated_ns = seconds_to_ns(safety.saturated_s)
        self._resume_slip = safety.resume_slip_linear, safety.resume_slip_angular
        self._slip_needed = params.controller == "vic"

    def find(
        self,
        state: SupervisorState,
        now_ns: int,
        joint: JointSample,
        slips: tuple[SlipSample, ...],
        health: Health,
        frozen: bool,
    ) -> tuple[Findings, Rung, SupervisorState]:
        """Return what speaks against the law in this cycle, the rung of the slip ladder, and the memory after it.

        Args:
            state: memory of the supervision.
            now_ns: the controller's clock.
            joint, slips: the newest samples.
            health: what the inputs are worth.
            frozen: whether the joint values have been equal to the last bit for long.

        Implements: ours: a fault wins over a reason to hold, and that over a reason to be careful.
        """
        slip = health.slip
        contradicted = state.contradicted_since_ns
        if slip == Trouble.NONE and contradicted is not None and now_ns - contradicted > _EVIDENCE_NS:
            slip = Trouble.IMPLAUSIBLE
        rung, words, unknown = Rung.MEASURED, "", ""
        if (slip not in FINE and self._slip_needed) or state.ladder.since_ns is not None:
            unknown = say("slip velocity", slip) if self._slip_needed and slip not in FINE else ""
            ladder, rung, words = descend(state.ladder, unknown, now_ns, self.ladder)
            state = state._replace(ladder=ladder)
        fault, watched = "", state.watched
        fastest = too_fast_index(joint.velocity, self.walls, self.speeds, watched, TRIP)
        if fastest >= 0 or state.fast_since_ns is not None:
            since = None if fastest < 0 else now_ns if state.fast_since_ns is None else state.fast_since_ns
            state = state._replace(fast_since_ns=since)
            if since is not None and now_ns - since > _FAST_NS:
                fault = too_fast(self._limits, self._joint_names, joint.velocity, watched[7:13])
        if watched[0] > self.load.drop_speed:
            fault = fault or cannot_carry(self.load, float(watched[0]))
        hold = degraded = ""
        if health.outside == Trouble.FOREIGN_COMMAND:
            fault = fault or say("effort command", health.outside)
        elif health.outside != Trouble.NONE:
            hold = say("an input", health.outside)
        elif health.wrench not in FINE:
            hold = say("wrench", health.wrench)
        elif now_ns - state.now_ns > self.gap_ns and state.mode.mode != Mode.WAITING_INPUT:
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
        linear, angular = self._resume_slip
        return any(
            linear * linear < v[:3].dot(v[:3]) or angular * angular < v[3:].dot(v[3:]) for v in (s.twist for s in slips)
        )
