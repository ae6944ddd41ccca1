"""Whether what a joint's sensors say can be true.

Position and velocity are compared with each other: where their difference grows beyond noise, one of them is wrong, and
the joint continues with the other. A joint that moves and reads the same to the last bit is not measured: the model
tells where it is.
"""

from __future__ import annotations

import math
from typing import Final

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_vic_controller.arm.joint_estimate import LONGEST_S, EstimatorConfig, Finding, JointEstimate, Trust, find

BLIND_S: Final = 0.5
"""Time for which the model tells where a joint is that is not measured [s]: enough to come to rest, not to hold it."""
REPEATED: Final = 1e-3
UNMOVED: Final = 3e-4
"""Velocity of a sensor without noise [rad/s], and way by any velocity [rad] (of an encoder that is read in steps two of
them), with which a joint that is measured does not read the same to the last bit."""
MEMORY_S: Final = 0.5
"""Time over which position and velocity are compared [s]."""
GAP: Final = 1.5
"""Sensor periods between two samples from which one is missing."""
LATELY: Final = 3.0
LATELY_S: Final = 0.006
"""Sensor periods, and least time [s], over which it is judged which of the two is wrong."""
STUCK: Final = 3
"""Positions in a row that are equal to the last bit while the velocity is not zero: then they are stuck."""
REVERSALS, DEAD = 20, 10
"""Reversals of the velocity from one sample to the next, without repetitions, which show that an encoder has noise:
motion alone does not make them. And repetitions in a row that it has not then: it has died."""
OPPOSED, SAME_SIZE = 0.3, 0.8
"""Share of the longer of two ways in opposite directions from which the shorter one is no noise, and from which both
are one way with a wrong sign."""
LAG_S: Final = 0.01
"""Time by which a velocity may be behind its position before they contradict each other, as behind a low-pass of 16 Hz
[s]."""
MOVES: Final = 0.02
"""Speed from which the sign of a joint's friction is known [rad/s]."""


@part
def count_unmeasured(
    config: EstimatorConfig, state: JointEstimate, stamp_ns: int, periods: int, q: Array, qd: Array, all_repeat: bool,
    measured: bool,
) -> None:  # fmt: skip
    """Count for how long every joint has read the same (n,) [rad], [rad/s] though it moves, or never did before.

    All of them where all read the same and one moves, or nothing was measured. What a joint did for longer than
    LONGEST_S is not known: then it begins again at what it reads. periods: since the sample before, of control;
    all_repeat: see `repeats`; the others: see `estimate_joints`.
    """
    dt, renewed_s = (stamp_ns - state.stamp_ns) * 1e-9, (stamp_ns - state.renewed_ns) * 1e-9
    moves = not measured
    for j in range(config.joints):
        moves = moves or abs(qd[j]) > config.repeated or abs(qd[j]) * renewed_s > config.unmoved
    for j in range(config.joints):
        unknown = state.trust[j] == Trust.NEITHER
        dead = abs(qd[j]) > MOVES or never_same(config, state, j) or unknown
        if (all_repeat and moves) or (dead and joint_repeats(state, j, q, qd)):
            state.unmeasured[j] += periods
            continue
        if unknown or state.unmeasured[j] * config.period > LONGEST_S:
            state.q[j], state.v[j] = q[j] - dt * qd[j], qd[j]
        if unknown:
            state.trust[j] = Trust.BOTH.value
        state.unmeasured[j] = 0


@part
def is_unmeasured(config: EstimatorConfig, state: JointEstimate, j: int) -> bool:
    """Return whether joint j reads the same for longer than its sensor repeats itself, which nothing measured does."""
    return bool(state.unmeasured[j] >= config.sensor_ticks)


@part
def all_unmeasured(config: EstimatorConfig, state: JointEstimate) -> bool:
    """Return whether that holds of all joints: then nothing corrects the estimate, and innovations grow longer."""
    return bool(state.unmeasured[: config.joints].min() >= config.sensor_ticks)


@part
def is_blind(config: EstimatorConfig, state: JointEstimate) -> bool:
    """Return whether a joint has not been measured for so long that the model cannot tell where it is."""
    return unseen_ns(config, state) > 1e9 * BLIND_S


@part
def unseen_ns(config: EstimatorConfig, state: JointEstimate) -> float:
    """Return for how long a joint has not been measured [ns]."""
    return float(1e9 * (state.unmeasured.max() * config.period))


@part
def repeats(config: EstimatorConfig, state: JointEstimate, q: Array, qd: Array) -> bool:
    """Return whether a sample (n,) [rad], [rad/s] is equal to the one before to the last bit."""
    repeated = True
    for j in range(config.joints):
        repeated = repeated and joint_repeats(state, j, q, qd)
    return repeated


@part
def joint_repeats(state: JointEstimate, j: int, q: Array, qd: Array) -> bool:
    """Return whether joint j reads the same as in the sample before, to the last bit; (n,) [rad], [rad/s]."""
    return bool(q[j] == state.measured_position[j] and qd[j] == state.measured_velocity[j])


@part
def compare_measurements(config: EstimatorConfig, state: JointEstimate, dt: float, q: Array, qd: Array) -> None:
    """Compare the way that positions show with that of the velocities, both faded over MEMORY_S.

    Between two samples the velocity may have had any value between theirs; where one is missing, any at all, and that
    way is not compared.
    Where they differ, the joint continues with the measurement that is not to blame: one that is equal to the last bit
    while the other moves is stuck, one that moves alone drifts. Where they move in opposite directions, in the newest
    sample or lately, it is the velocity: damping by it would throw the joint, while a position that drifts moves the
    joint no faster than that. Where both are stuck, or an encoder with noise repeats itself, it continues by the model
    alone, until it reads something else.
    """
    fade, fade_lately = math.exp(-dt / MEMORY_S), math.exp(-dt / max(LATELY * config.sensor_period, LATELY_S))
    for j in range(config.joints):
        before_q, before_v = state.measured_position[j], state.measured_velocity[j]
        way_q = way_v = 0.0
        if state.missing == 0 and dt < GAP * config.sensor_period:
            way_q = q[j] - before_q
            way_v = min(max(way_q, dt * min(qd[j], before_v)), dt * max(qd[j], before_v)) if state.alone == 0 else way_q
        state.moved[j], state.swept[j] = fade * state.moved[j] + way_q, fade * state.swept[j] + way_v
        state.moved_lately[j] = fade_lately * state.moved_lately[j] + way_q
        state.swept_lately[j] = fade_lately * state.swept_lately[j] + way_v
        if same(state, j) > 0 and not (q[j] == before_q and qd[j] == before_v):
            state.reversals[j] = 0
        elif before_v * qd[j] < 0.0:
            state.reversals[j] += 1
        state.same_position[j] = state.same_position[j] + 1 if q[j] == before_q else 0
        state.same_velocity[j] = state.same_velocity[j] + 1 if qd[j] == before_v else 0
        state.measured_position[j], state.measured_velocity[j] = q[j], qd[j]
        moved, swept = state.moved_lately[j], state.swept_lately[j]
        difference = abs(contradiction(state, j))
        if state.trust[j] == Trust.BOTH and never_same(config, state, j) and same(state, j) >= DEAD:
            state.trust[j] = Trust.NEITHER.value
            find(state, Finding.STUCK.value, j, 0.0, 0.0)
        if state.trust[j] != Trust.BOTH or not difference > config.difference:
            continue
        finding, trust = Finding.VELOCITY_BIASED.value, Trust.POSITION.value
        if state.same_velocity[j] > 0 and way_q != 0.0:
            finding = Finding.VELOCITY_STUCK.value
        elif same(state, j) >= STUCK:
            finding, trust = Finding.STUCK.value, Trust.NEITHER.value
        elif state.same_position[j] >= STUCK:
            finding, trust = Finding.POSITION_STUCK.value, Trust.VELOCITY.value
        elif opposed(way_q, dt * qd[j], OPPOSED) or opposed(moved, swept, OPPOSED):
            if opposed(way_q, dt * qd[j], SAME_SIZE) or opposed(moved, swept, SAME_SIZE):
                finding = Finding.VELOCITY_SIGN.value
        elif abs(moved) > abs(swept):
            finding, trust = Finding.POSITION_DRIFTS.value, Trust.VELOCITY.value
        state.trust[j] = trust
        find(state, finding, j, difference, config.difference)


@part
def contradiction(state: JointEstimate, j: int) -> float:
    """Return what position shows beyond velocity [rad] that a velocity which is up to LAG_S late does not explain."""
    difference = state.moved[j] - state.swept[j]
    late = LAG_S * gained(state, j)
    return float(difference - min(max(difference, min(late, 0.0)), max(late, 0.0)))


@part
def gained(state: JointEstimate, j: int) -> float:
    """Return the faded sum of the changes of the velocity of joint j [rad/s]; a second behind, its way lacks as much.

    Implements: ours: by parts it is the velocity now, less its faded mean.
    """
    return float(state.measured_velocity[j] - state.swept[j] / MEMORY_S)


@part
def same(state: JointEstimate, j: int) -> int:
    """Return for how many samples in a row joint j has read the same to the last bit."""
    return int(min(state.same_position[j], state.same_velocity[j]))


@part
def never_same(config: EstimatorConfig, state: JointEstimate, j: int) -> bool:
    """Return whether the encoder of joint j has noise, and so never reads the same twice."""
    return bool(config.on != 0 and state.reversals[j] >= REVERSALS)


@part
def opposed(a: float, b: float, share: float) -> bool:
    """Return whether two ways [rad] go in opposite directions, the shorter by more than a share of the longer."""
    return a * b < 0.0 and min(abs(a), abs(b)) > share * max(abs(a), abs(b))
