"""Limits, drop detection, latency and arbitration in plain form."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_vic_controller.safety.arbitration import Level
from slip_vic_controller.safety.faults import Fault, Input, describe_fault
from slip_vic_controller.safety.modes import Mode

# -- effort limiter -----------------------------------------------------------------------------------


def limit_effort(effort_limit: Array, step: float, before: Array, wanted: Array) -> tuple[Array, Array, Array, bool]:
    """Return effort, clipped or limited, limited, and whether `wanted` was finite."""
    finite = bool(np.isfinite(wanted).all() and (np.abs(wanted) <= 1e154).all())
    wanted = wanted if finite else before
    inside = np.clip(wanted, -effort_limit, effort_limit)
    effort = np.clip(np.clip(inside, before - step, before + step), -effort_limit, effort_limit)
    return effort, (effort != inside) | (inside != wanted), effort != inside, finite


# -- limit avoidance ----------------------------------------------------------------------------------


def joint_repulsion(limits: Any, q: Array, qd: Array, M: Array) -> Array:
    """Return the torque away from stops and against too high velocities; limits: MOTION_LIMITS of n joints.

    M: (n, n) [kg m2]; braking ends before the joint turns round, also where efforts are 20 ms late:
    tau T + tau^2 / (2 rate) <= |qd| / (2 (M^-1)_jj).
    """
    n, drive = len(q), limits.drive
    T, inertia = 1e-9 * drive.period_ns + 0.020, 1.0 / np.diag(np.linalg.inv(M))
    low = np.clip((limits.near_lower[:n] - q) / limits.margin, 0.0, 1.0)
    high = np.clip((q - limits.near_upper[:n]) / limits.margin, 0.0, 1.0)
    reach = limits.velocity[:n] - limits.brake_from[:n]
    brake = drive.effort[:n] * np.clip((np.abs(qd) - limits.brake_from[:n]) / reach, 0.0, 1.0)
    most = [max(np.roots((0.5 / drive.rate, T, -0.5 * m * abs(v))).real) for m, v in zip(inertia, qd, strict=True)]
    return drive.effort[:n] * (low**2 - high**2) - np.sign(qd) * np.minimum(brake, most)


def pad_brake(limits: Any, J: Array, twist: Array) -> Array:
    """Return the torque of a Cartesian damper of 100 N s/m, 10 N m s/rad on the speed above 3/4 of the limits."""
    force = np.zeros(6)
    for half, limit, damping in ((slice(3), limits.speed_linear, 100.0), (slice(3, 6), limits.speed_angular, 10.0)):
        speed = float(np.linalg.norm(twist[half]))
        if speed > 0.75 * limit:
            force[half] = -damping * (speed - 0.75 * limit) * twist[half] / speed
    return J.T @ force


def too_fast(limits: Any, names: tuple[str, ...], qd: Array, twist: Array) -> str:
    over = np.abs(qd) > limits.trip[: len(qd)]
    if over.any():
        i = int(over.argmax())
        return f"{names[i]} turns at {abs(qd[i]):.1f} rad/s, the limit is {limits.velocity[i]:.1f}"
    halves = (twist[:3], limits.speed_linear, "m/s"), (twist[3:], limits.speed_angular, "rad/s")
    for half, limit, unit in halves:
        speed = float(np.linalg.norm(half))
        if speed > limit * 4.0 / 3.0:
            return f"the pad moves at {speed:.1f} {unit}, the limit is {limit:.1f}"
    return ""


# -- drop detection -----------------------------------------------------------------------------------


def fall_speed(down: Array, rise: float, speed: float, beyond: Array, P: Array, slipping: float, dt: float) -> float:
    """Return the speed `beyond` the reference along `down` in the directions of slip, `speed` before; P projects."""
    return float(np.clip(slipping * (down @ P @ beyond), 0.0, speed + rise * dt))


def slip_evidence(evidence: Array, change: Array, carried: Array, P: Array, dt: float) -> Array:
    """Return what a_ee - G^T a_o has added up to over the last 0.1 s."""
    return evidence * math.exp(-dt / 0.1) + P @ (change - dt * carried)


# -- latency ------------------------------------------------------------------------------------------


class Latency(NamedTuple):
    least_ns: int | None = None
    last_ns: int = 0
    most_ns: int = 0
    in_a_row: int = 0


def answered(before: Latency, now_ns: int, stamp_ns: int, dt_ns: int, late_ns: int) -> Latency:
    took_ns = now_ns - stamp_ns
    least = took_ns if before.least_ns is None else before.least_ns
    if before.last_ns < 5_000_000:
        least += round(5e-4 * dt_ns)
    least = min(least, took_ns)
    last = took_ns - least
    sure = min(last, before.last_ns)
    fading = before.most_ns - round(before.most_ns * min(1.0, dt_ns * 1e-9 / 0.5))
    return Latency(least, last, max(sure, fading), before.in_a_row + 1 if 0 < late_ns <= sure else 0)


# -- arbitration --------------------------------------------------------------------------------------


class Memory(NamedTuple):
    """What arbitration looks at, None = not so."""

    now_ns: int
    mode: Mode
    slip_unknown_ns: int | None
    too_fast_ns: int | None
    saturated_ns: int | None
    stopping_ns: int | None
    blind_ns: int | None
    fall_speed: float
    slip_variance: Array
    path_speed: float
    path_scale: float
    reference_moves: bool
    unseen_ns: int
    frozen_before: bool
    wrench_bad_ns: int | None
    late_in_a_row: int
    pad_twist: Array
    slips: tuple[Array, ...]
    slid_before: bool


class Verdict(NamedTuple):
    fault: str
    hold: str
    degraded: str
    level: Level
    slip_unknown_ns: int | None
    too_fast_ns: int | None


def arbitrate(
    config: Any, names: tuple[str, ...], memory: Memory, health: tuple[Fault, ...], frozen: bool, q: Array, qd: Array,
    now_ns: int,
) -> Verdict:  # fmt: skip
    """Return what speaks against the law; config: CONFIG; health: wrench, slip velocity, outside."""
    wrench, slip, outside = health
    limits, follows = config.arbitration, memory.mode in (Mode.ACTIVE, Mode.DEGRADED)
    if slip == Fault.NONE and memory.blind_ns is not None and now_ns - memory.blind_ns > limits.blind_ns:
        slip = Fault.IMPLAUSIBLE
    unknown = bool(limits.slip_needed) and slip not in (Fault.NONE, Fault.DENORMAL)
    since, level, words = None, Level.MEASURED, ""
    slip_words = describe_fault(Input.SLIP, slip)
    if unknown:
        since = now_ns if memory.slip_unknown_ns is None else memory.slip_unknown_ns
        passed = now_ns - since
        if passed < limits.observer_ns:
            level, words = Level.OBSERVED, f"{slip_words}: predicting it from the wrench"
        elif passed < limits.observer_ns + limits.slow_down_ns:
            level, words = Level.SLOWING, f"{slip_words}: slowing down"
        else:
            level = Level.HOLD
    wrench_bad = wrench not in (Fault.NONE, Fault.DENORMAL)
    wrench_since = now_ns if memory.wrench_bad_ns is None else memory.wrench_bad_ns
    fastest, fast_since, fault = too_fast(config.motion, names, qd, memory.pad_twist), None, ""
    if fastest:
        fast_since = now_ns if memory.too_fast_ns is None else memory.too_fast_ns
        fault = fastest if now_ns - fast_since > 5_000_000 else ""
    deviation = math.sqrt(np.max(memory.slip_variance[:3])) if config.estimator.on else 0.0
    if not fault and memory.fall_speed > config.drop.drop_speed + 3.0 * deviation:
        fault = f"the object falls: it slips, and moves down {memory.fall_speed:.2f} m/s faster than the reference"
    if outside == Fault.FOREIGN_COMMAND:
        fault = fault or describe_fault(Input.EFFORT_COMMAND, outside)
        return Verdict(fault, "", "", level, since, fast_since)
    holds = (
        (outside != Fault.NONE, describe_fault(Input.ANY, outside)),
        (
            wrench_bad and not (follows and now_ns - wrench_since < limits.slow_down_ns),
            describe_fault(Input.WRENCH, wrench),
        ),
        (
            now_ns - memory.now_ns > limits.gap_ns and memory.mode != Mode.WAITING_INPUT,
            describe_fault(Input.JOINT_STATE, Fault.NOT_RUN),
        ),
        (memory.late_in_a_row >= limits.late_after, describe_fault(Input.JOINT_STATE, Fault.LATE)),
        (
            memory.unseen_ns > (limits.unseen_ns if follows else limits.bridge_ns),
            describe_fault(Input.JOINT_STATE, Fault.FROZEN),
        ),
        (
            frozen and (memory.frozen_before or (memory.reference_moves and follows and memory.unseen_ns == 0)),
            describe_fault(Input.JOINT_STATE, Fault.FROZEN),
        ),
        (level == Level.HOLD or (unknown and not follows), slip_words),
        (
            not follows
            and bool(limits.slip_needed)
            and memory.slid_before
            and any(_slides(limits, v) for v in memory.slips),
            "the object slides: waiting until it rests",
        ),
    )
    hold = next((text for so, text in holds if so), "")
    cares = (
        (memory.unseen_ns > limits.bridge_ns, f"{describe_fault(Input.JOINT_STATE, Fault.FROZEN)}: slowing down"),
        (wrench_bad and follows, f"{describe_fault(Input.WRENCH, wrench)}: slowing down"),
        (bool(words), words),
        (memory.stopping_ns is not None, "hold requested: coming to rest first"),
        (
            memory.saturated_ns is not None and now_ns - memory.saturated_ns > limits.saturated_ns,
            "efforts saturated: slip cannot be driven to zero",
        ),
        (
            memory.path_speed < 1.0 or memory.path_scale < 1.0,
            _pushed(config.motion, names, q) or "the path waits for the arm",
        ),
    )
    degraded = "" if hold else next((text for so, text in cares if so), "")
    return Verdict(fault, hold, degraded, level, since, fast_since)


def _pushed(limits: Any, names: tuple[str, ...], q: Array) -> str:
    depths = np.maximum(limits.near_lower[: len(q)] - q, q - limits.near_upper[: len(q)])
    j = int(np.argmax(depths))
    if depths[j] <= 0.0:
        return ""
    return f"{names[j]} is pushed back from the end of its range, at {q[j]:.2f} rad: the pad cannot keep to the path"


def _slides(limits: Any, v: Array) -> bool:
    fast = np.linalg.norm(v[:3]) > limits.resume_slip_linear, np.linalg.norm(v[3:]) > limits.resume_slip_angular
    return bool(fast[0] or fast[1])
