"""The parts of safety as functions over buffers: what runs inside of the cycle, called from a test."""

from __future__ import annotations

import numpy as np

from slip_core.compiled import BOOL, IN1, INT, OUT1, OUT2, REAL, VOID, kernel
from slip_core.records import WHOLE, layout, record
from slip_core.vectors import mat, put_spatial, spatial, vec
from slip_vic_controller.cycle import CONFIG, STATE, STATE_SIZE
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.law import EVALUATION
from slip_vic_controller.reference.paths import REFERENCE
from slip_vic_controller.safety import hold, latency
from slip_vic_controller.safety.arbitration import HEALTH, arbitrate, watch_for_blindness
from slip_vic_controller.safety.drop_detection import DROP_DETECTION, OBSERVED, observe_motion
from slip_vic_controller.safety.effort_limiter import (
    EFFORT_LIMITS,
    LIMITER,
    largest_step,
    limit_effort,
    needs_restart,
    start_limiter,
)
from slip_vic_controller.safety.hold import HOLD, HOLD_CONFIG
from slip_vic_controller.safety.latency import LATENCY, SLIP_LATENCY
from slip_vic_controller.safety.limit_avoidance import MOTION_LIMITS, avoid_limits
from slip_vic_controller.safety.modes import MODE, MODE_POLICY, TransitionReasons, begin_modes, next_mode
from slip_vic_controller.safety.reasons import REASON, put_reason, read_reason
from slip_vic_controller.safety.validation import JOINT_SAMPLE, SLIP_QUEUE, vector_validity

TRANSITION_REASONS = layout(missing=REASON, fault=REASON, hold=REASON, degraded=REASON)
ARBITRATED = layout(fault=REASON, hold=REASON, degraded=REASON, level=WHOLE)


@kernel(VOID(IN1, OUT1, INT))
def run_begin_modes(policy, state, now_ns) -> None:
    begin_modes(record(policy, MODE_POLICY), record(state, MODE), now_ns)


@kernel(VOID(IN1, OUT1, IN1, INT, INT))
def run_modes(policy, state, reasons, request, now_ns) -> None:
    r = record(reasons, TRANSITION_REASONS)
    found = TransitionReasons(
        read_reason(r.missing), read_reason(r.fault), read_reason(r.hold), read_reason(r.degraded)
    )
    next_mode(record(policy, MODE_POLICY), record(state, MODE), found, request, now_ns)


@kernel(VOID(IN1, OUT1, IN1, BOOL, IN1, INT, OUT1))
def run_arbitrate(config, state, health, frozen, qd, now_ns, out) -> None:
    c, o = record(config, CONFIG), record(out, ARBITRATED)
    found, level = arbitrate(
        c, record(state[:STATE_SIZE], STATE), record(health, HEALTH), frozen, c.law.joints, c.law.contacts, qd, now_ns
    )
    put_reason(o.fault, found.fault)
    put_reason(o.hold, found.hold)
    put_reason(o.degraded, found.degraded)
    o.level = level


@kernel(VOID(OUT1, REAL, REAL, INT))
def run_blindness(observed, slip_speed, evidence, now_ns) -> None:
    watch_for_blindness(record(observed, OBSERVED), slip_speed, evidence, now_ns)


@kernel(INT(IN1, OUT1, INT, IN1, INT, OUT2))
def run_limiter(limits, state, n, wanted, now_ns, flags) -> int:
    """flags: clipped, limited; (2, n)."""
    finite = limit_effort(record(limits, EFFORT_LIMITS), record(state, LIMITER), n, wanted, now_ns, flags[0], flags[1])
    return 1 if finite else 0


@kernel(VOID(IN1, OUT1, INT, IN1, IN1, INT))
def run_start_limiter(limits, state, n, measured, gravity, now_ns) -> None:
    start_limiter(record(limits, EFFORT_LIMITS), record(state, LIMITER), n, measured, gravity, now_ns)


@kernel(BOOL(IN1, IN1, INT))
def limiter_needs_restart(limits, state, now_ns) -> bool:
    return needs_restart(record(limits, EFFORT_LIMITS), record(state, LIMITER), now_ns)


@kernel(REAL(IN1, IN1, INT))
def limiter_step(limits, state, now_ns) -> float:
    return largest_step(record(limits, EFFORT_LIMITS), record(state, LIMITER), now_ns)


@kernel(VOID(IN1, INT, IN1, IN1, IN1, BOOL, OUT1))
def run_limit_avoidance(limits, n, q, qd, arm, braked, torque) -> None:
    avoid_limits(record(limits, MOTION_LIMITS), n, q, qd, record(arm, ARM), braked, torque)


@kernel(VOID(IN1, IN1, OUT1, IN1, IN1, IN1, REAL))
def run_drop_detection(config, axes, state, arm, law, reference, dt) -> None:
    observe_motion(
        record(config, DROP_DETECTION), axes, record(state, OBSERVED), record(arm, ARM), record(law, EVALUATION),
        record(reference, REFERENCE), dt,
    )  # fmt: skip


@kernel(VOID(IN1, IN1, IN1, IN1, IN1, IN1, REAL, BOOL, OUT1))
def run_hold(config, state, arm, sample, pad, r_pad, late_s, carries, torque) -> None:
    """pad: attitude of the pad in the object, by rows; (9,)."""
    c, s, a = record(config, HOLD_CONFIG), record(state, HOLD), record(arm, ARM)
    hold.hold_effort(c, s, a, record(sample, JOINT_SAMPLE), mat(pad.reshape(3, 3)), vec(r_pad), late_s, torque)
    if carries:
        hold.carry_load(c, s, a, vec(r_pad), torque)


@kernel(VOID(IN1, OUT1, IN1, IN1, IN1, REAL))
def run_hold_load(config, state, arm, r_pad, measured, dt) -> None:
    hold.update_load_error(
        record(config, HOLD_CONFIG), record(state, HOLD), record(arm, ARM), vec(r_pad), spatial(measured), dt
    )


@kernel(VOID(OUT1, IN1, IN1, REAL, REAL))
def run_load_error(error, model, measured, dt, memory_s) -> None:
    put_spatial(error, hold.load_error(spatial(error), spatial(model), spatial(measured), dt, memory_s))


@kernel(REAL(REAL, REAL, REAL))
def delay_margin(stiffness, damping, excess) -> float:
    return hold.delay_margin(stiffness, damping, excess)


@kernel(VOID(REAL, REAL, REAL, OUT1))
def run_gains_for_delay(stiffness, damping, delay_s, out) -> None:
    out[0], out[1] = hold.gains_for_delay(stiffness, damping, delay_s)


@kernel(VOID(OUT1, INT, INT, INT, INT))
def run_latency(state, now_ns, stamp_ns, dt_ns, late_ns) -> None:
    latency.measure_latency(record(state, LATENCY), now_ns, stamp_ns, dt_ns, late_ns)


@kernel(VOID(OUT1, INT, IN1, INT, OUT1))
def run_slip_latency(state, now_ns, queue, period_ns, cycles) -> None:
    """cycles: held, late."""
    s = record(state, SLIP_LATENCY)
    latency.measure_slip_latency(s, now_ns, record(queue, SLIP_QUEUE))
    cycles[0], cycles[1] = latency.whole_cycles(s, period_ns)


@kernel(INT(IN1, IN1, BOOL, INT, INT, BOOL))
def run_validity(config, state, is_slip, now_ns, joint_stamp_ns, arm_moves) -> int:
    """Return why the newest sample of contact 0 does not count."""
    c, s = record(config, CONFIG), record(state[:STATE_SIZE], STATE)
    if is_slip:
        return vector_validity(c.slip, s.slip_inputs[0], now_ns, joint_stamp_ns, arm_moves)
    return vector_validity(c.wrench, s.wrench_inputs[0], now_ns, joint_stamp_ns, arm_moves)


def gains_for_delay(stiffness: float, damping: float, delay_s: float) -> tuple[float, float]:
    out = np.empty(2)
    run_gains_for_delay(stiffness, damping, delay_s, out)
    return float(out[0]), float(out[1])
