"""The control cycle of two arms that hold one object: what `cycle` does for each, decided together.

Each arm knows all contacts, its own first, so h_o and the internal wrench are the law's. What is here is the rest: the
law works for both or for neither, in the same cycle, and both run through the path at the speed of the slower one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from slip_core.arrays import Array
from slip_core.compiled import IN1, INT, OUT1, kernel, part
from slip_core.records import record
from slip_vic_controller.cycle import (
    CONFIG,
    INPUTS,
    OUTPUTS,
    STATE,
    STATE_SIZE,
    Decision,
    Step,
    begin_cycle,
    bridges,
    end_cycle,
)
from slip_vic_controller.observer.layouts import ROW_SIZE
from slip_vic_controller.reference.path_grid import Governing
from slip_vic_controller.safety.faults import Fault, Input
from slip_vic_controller.safety.modes import NOTHING, TransitionReasons, follows, next_mode
from slip_vic_controller.safety.reasons import Cause, Reason, of_fault, put_reason, read_reason
from slip_vic_controller.sizes import NEVER


class ModeBefore(NamedTuple):
    """The mode before a cycle."""

    mode: int
    since_ns: int
    enabled: int
    good_since_ns: int
    reason: Reason


@part
def mode_before(s: Any) -> ModeBefore:
    """Return the mode, to come back to it."""
    return ModeBefore(s.mode.mode, s.mode.since_ns, s.mode.enabled, s.mode.good_since_ns, read_reason(s.mode.reason))


@part
def works(c: Any, s: Any, i: Any, decision: Decision) -> bool:
    """Return whether the law works in this cycle, or its last effort is repeated."""
    if decision.step == Step.BRIDGE and not bridges(c, s, i.now_ns):
        return False
    return decision.step != Step.NONE and follows(s.mode.mode)


@part
def hold_with_the_other(c: Any, s: Any, i: Any, o: Any, decision: Decision, before: ModeBefore, worked: bool) -> None:
    """Hold because the other arm does; both count anew from here until they may resume, so they resume together."""
    if worked:
        s.mode.mode, s.mode.since_ns, s.mode.enabled = before.mode, before.since_ns, before.enabled
        s.mode.good_since_ns = before.good_since_ns
        put_reason(s.mode.reason, before.reason)
        reason = of_fault(Cause.INPUT, Input.ANY, Fault.OTHER_ARM)
        reasons = TransitionReasons(NOTHING, decision.reasons.fault, reason, NOTHING)
        next_mode(c.modes, s.mode, reasons, decision.request, i.now_ns)
        if o.health.outside == Fault.NONE:
            o.health.outside = Fault.OTHER_ARM.value
    s.mode.good_since_ns = NEVER


@part
def share_path(s: Any, other: Any) -> None:
    """Let both arms run through the path at one speed and from one start."""
    speed = min(s.observed.path_speed, other.observed.path_speed)
    s.observed.path_speed = other.observed.path_speed = speed
    other.law.start_ns = s.law.start_ns
    other.path.scale, other.path.rate = s.path.scale, s.path.rate


@part
def agree_on_friction(config: Any, s: Any, other: Any) -> None:
    """Let both arms believe in the weaker pad, and know when one of them slips; ESTIMATE_CONFIG, STATE of each.

    Each pad's sensor tells of its own slip only, so it is over when no sample of either has shown one for so long.
    """
    a, b = s.governor.estimate, other.governor.estimate
    a.F_hat = b.F_hat = min(a.F_hat, b.F_hat)
    slipping, newest = max(a.slipping, b.slipping), max(a.slip_ns, b.slip_ns)
    if slipping != 0 and s.joint.answers.stamp_ns - newest >= config.quiet_ns + config.sensor_delay_ns:
        slipping = 0
    a.slipping = b.slipping = slipping
    a.slip_ns = b.slip_ns = newest


@part
def lead(s: Any, other: Any) -> None:
    """Let the other arm be where this one is on the path; s, other: STATE."""
    a, b = s.governor, other.governor
    b.led = 1
    b.s, b.rate, b.time, b.end, b.arrived, b.phase, b.planned = (
        a.s,
        a.rate,
        a.time,
        a.end,
        a.arrived,
        a.phase,
        a.planned,
    )
    b.out_s, b.out_rate, b.out_u, b.out_time = a.out_s, a.out_rate, a.out_u, a.out_time
    b.plan_load, b.infeasible, b.overrun, b.strained = a.plan_load, a.infeasible, a.overrun, a.strained
    b.halted = a.halted
    b.usable, b.ceiling = a.usable, a.ceiling  # what is commanded is known by them, and from it where a pad has slipped
    b.heaviest_time, b.weight_load = a.heaviest_time, a.weight_load


@kernel(INT(IN1, OUT1, IN1, OUT1, IN1, OUT1, IN1, OUT1))
def team_cycle(
    config_l: Array, state_l: Array, inputs_l: Array, outputs_l: Array,
    config_r: Array, state_r: Array, inputs_r: Array, outputs_r: Array,
) -> int:  # fmt: skip
    """Answer the joint states of both arms; arguments as of `cycle`, left and right.

    Returns:
        Bits of the arms that have an effort: 1 left, 2 right.
    """
    c_l, s_l = record(config_l, CONFIG), record(state_l[:STATE_SIZE], STATE)
    c_r, s_r = record(config_r, CONFIG), record(state_r[:STATE_SIZE], STATE)
    i_l, o_l, i_r, o_r = record(inputs_l, INPUTS), record(outputs_l, OUTPUTS), record(inputs_r, INPUTS), record(
        outputs_r, OUTPUTS
    )  # fmt: skip
    if s_l.law.known == 0 or s_r.law.known == 0:  # one path: who begins anew does so with the other
        s_l.law.known, s_r.law.known = 0, 0
    before_l, before_r = mode_before(s_l), mode_before(s_r)
    left, right = begin_cycle(c_l, s_l, i_l, o_l), begin_cycle(c_r, s_r, i_r, o_r)
    works_l, works_r = works(c_l, s_l, i_l, left), works(c_r, s_r, i_r, right)
    if works_l != works_r:
        hold_with_the_other(c_l, s_l, i_l, o_l, left, before_l, works_l)
        hold_with_the_other(c_r, s_r, i_r, o_r, right, before_r, works_r)
    governed = c_l.governor.mode != Governing.OFF and c_r.governor.mode != Governing.OFF
    if governed:
        agree_on_friction(c_l.governor.estimate, s_l, s_r)
    end_cycle(c_l, s_l, state_l[STATE_SIZE:].reshape(-1, ROW_SIZE), i_l, o_l, left)
    if governed:
        lead(s_l, s_r)
    end_cycle(c_r, s_r, state_r[STATE_SIZE:].reshape(-1, ROW_SIZE), i_r, o_r, right)
    if works_l and works_r:
        share_path(s_l, s_r)
    return o_l.answered + 2 * o_r.answered
