"""How late efforts reach the joints beyond what is told, from what the joints do.

A law whose efforts come late swings the arm, more with every swing, and no stamp shows why. But joints that follow the
efforts of some time ago show how long ago that was: with the model's torque for the motion,

    M (change of v) - model without delay  =  impulse of the efforts then - impulse of the efforts now,

so the left side is compared with the right one for each of some delays, over blocks of a few milliseconds, each without
its mean, and of joints that move: offsets, friction and what else holds a joint are no delay while efforts rise. Where
a delay explains it, and is more than the law bears, that is a finding: the arm is held with gains for this delay.
"""

from __future__ import annotations

import math
from typing import Annotated, Final

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Whole, dtype_of
from slip_vic_controller.arm.estimator import input_of
from slip_vic_controller.arm.joint_estimate import MAX_LATENCY, EstimatorConfig, Finding, JointEstimate, find
from slip_vic_controller.arm.plausibility import MOVES
from slip_vic_controller.sizes import MAX_JOINTS, Joints, WholeJoints

DELAYS: Final = 8
LONGEST_S: Final = 0.033
"""Delays that are compared: whole blocks, at most so many and so long [s]."""
RING: Final = DELAYS + MAX_LATENCY + 1
"""Blocks that are kept: told delays lie before those that are compared."""
MEMORY_S: Final = 0.2
"""Time constant over which they are compared [s]."""
TURNS: Final = 5
"""Blocks in which a joint that moves may be slow, to turn round: one that rests longer begins anew, without a mean."""
LEAST, SWINGS = 0.01, 0.08
"""Torque without explanation from which a delay is looked for, and from which one that is borne elsewhere swings the
arm, as a share of the effort limits."""
EXPLAINED: Final = 0.8
"""Correlation from which a delay explains it."""
OTHER_SHARE: Final = 0.3
"""Share by which the torques of a delay may be off what they explain: those of a joint that friction holds are by half,
for there half an oscillation is as good as a delay."""
MOVED: Final = 0.1
"""Least square of the torque of the motion itself, over the variance of what is not explained: an arm that something
else moves follows no efforts at all."""
SHORT_S, BORNE_S = 0.0045, 0.0135
"""Delays beyond the told one that all laws bear, and that a law bears whose joint states are not estimated [s]: with
4 ms all work, with 12 ms those do, with 16 ms all swing."""
SURE_S: Final = 0.03
"""Time for which a delay must explain it, while joints move [s]: at rest nothing new speaks for it."""
LONGEST_BLOCK: Final = 4
"""Times its length that a block may last until the sensor shows something new; an arm at rest reads the same."""


class DriveDelay(Record):
    """What efforts and joints have shown of each other."""

    started: Whole
    periods: Whole  # in the block under way
    stamp_ns: Whole  # of the last sample
    velocity: Joints  # rad/s; at the beginning of the block
    gained: Joints  # rad/s; change of the velocity since then, if efforts are no later than told
    impulse: Joints  # N m s; of the efforts since then
    newest: Whole  # place of the last block in its ring
    blocks: Whole  # that have been kept
    torques: Annotated[Array, (RING, MAX_JOINTS)]  # mean effort of each block, share of the limit
    moves: WholeJoints  # blocks for which it still counts as one that moves
    mean_missing: Joints  # torque that is not explained, share of the limit
    mean_earlier: Annotated[Array, (DELAYS, MAX_JOINTS)]  # what each delay would make of it
    product: Annotated[Array, DELAYS]  # covariance of the two
    square: Annotated[Array, DELAYS]  # variance of what each delay would make of it
    unexplained: Real  # variance of what is not explained
    moved: Real  # square of the torque of the motion itself
    explained_s: Real  # s; for how long a delay that is too long has explained it
    found_s: Real  # s; the delay beyond the told one, 0 = none is too long


DRIVE_DELAY = dtype_of(DriveDelay)


@part
def forget_drive_delay(state: DriveDelay) -> None:
    """Begin anew: nothing has been seen."""
    state.started, state.blocks, state.explained_s, state.found_s = 0, 0, 0.0, 0.0
    state.unexplained, state.moved = 0.0, 0.0
    state.product[:] = 0.0
    state.square[:] = 0.0
    state.moves[:] = 0


@part
def watch_drive_delay(
    config: EstimatorConfig, state: DriveDelay, estimate: JointEstimate, M: Array, effort: Array, limit: Array
) -> None:
    """Take in what the joints did since the sample before, in which `effort` was the last that had been sent.

    Args:
        config, estimate: of the joint state estimator, which has taken the newest sample in; a finding may be added.
        state: changed.
        M: inertia (n, n) [kg m2].
        effort: (n,) [N m].
        limit: effort limits (n,) [N m].

    Implements: ours: correlation with each of some delays, as in C. H. Knapp and G. C. Carter, 1976, without weights.
    """
    n, period, length = config.joints, config.period, config.block_ticks
    if length == 0:
        return
    passed_s = (estimate.stamp_ns - state.stamp_ns) * 1e-9
    state.stamp_ns = estimate.stamp_ns
    if state.started == 0 or not 0.0 < passed_s < 1.5 * period:
        state.started, state.blocks = 1, 0
        _begin_block(state, estimate, n)
        return
    for j in range(n):
        state.gained[j] += passed_s * input_of(config, estimate, config.late_ticks, j)
        state.impulse[j] += passed_s * effort[j]
    state.periods += 1
    if state.periods > LONGEST_BLOCK * length:
        state.blocks = 0
        _begin_block(state, estimate, n)
    elif state.periods >= length and estimate.renewed_ns == estimate.stamp_ns:
        _end_block(config, state, estimate, M, limit, state.periods * period)
        _begin_block(state, estimate, n)


@part
def _begin_block(state: DriveDelay, estimate: JointEstimate, n: int) -> None:
    state.periods = 0
    for j in range(n):
        state.velocity[j], state.gained[j], state.impulse[j] = estimate.measured_velocity[j], 0.0, 0.0


@part
def _end_block(
    config: EstimatorConfig, state: DriveDelay, estimate: JointEstimate, M: Array, limit: Array, block_s: float
) -> None:
    """Compare a block of `block_s` [s] with those before; arguments as in `watch_drive_delay`."""
    n = config.joints
    state.newest = (state.newest + 1) % RING
    state.blocks += 1
    for j in range(n):
        state.torques[state.newest, j] = state.impulse[j] / (block_s * limit[j])
    told = round((config.late_ticks + config.drive_ticks) * config.period / block_s)
    if state.blocks <= told + DELAYS:
        return
    weight = 1.0 - math.exp(-block_s / MEMORY_S)
    kept, moving = 1.0 - weight, 0
    state.unexplained *= kept
    state.moved *= kept
    for delay in range(DELAYS):
        state.product[delay] *= kept
        state.square[delay] *= kept
    for j in range(n):
        v, before = estimate.measured_velocity[j], state.velocity[j]
        if v * before <= 0.0 or min(abs(v), abs(before)) < MOVES:
            state.moves[j] = max(0, state.moves[j] - 1)
            continue
        begins, state.moves[j], moving = state.moves[j] == 0, TURNS, 1
        moved = missing = 0.0
        for k in range(n):
            change = estimate.measured_velocity[k] - state.velocity[k]
            moved += M[j, k] * change
            missing += M[j, k] * (change - state.gained[k])
        moved, missing = moved / (block_s * limit[j]), missing / (block_s * limit[j])
        state.moved += weight * moved * moved
        if begins:
            state.mean_missing[j] = missing
        missing -= state.mean_missing[j]
        state.mean_missing[j] += weight * missing
        state.unexplained += kept * weight * missing * missing
        now = state.torques[(state.newest - told) % RING, j]
        for delay in range(DELAYS):
            earlier = state.torques[(state.newest - told - 1 - delay) % RING, j] - now
            if begins:
                state.mean_earlier[delay, j] = earlier
            earlier -= state.mean_earlier[delay, j]
            state.mean_earlier[delay, j] += weight * earlier
            state.product[delay] += kept * weight * missing * earlier
            state.square[delay] += kept * weight * earlier * earlier
    if moving != 0:
        _judge(config, state, estimate, block_s)


@part
def _judge(config: EstimatorConfig, state: DriveDelay, estimate: JointEstimate, block_s: float) -> None:
    """Find the delay that explains most, and whether it is too long."""
    best, most = 0, 0.0
    for delay in range(min(DELAYS, int(LONGEST_S / block_s))):
        explained = state.product[delay] / math.sqrt(state.square[delay] * state.unexplained + 1e-30)
        if explained > most:
            best, most = delay, explained
    # Between two delays the nearest one explains a share of what it would make of it.
    share = state.product[best] / (state.square[best] + 1e-30)
    delay_s = (best + 1) * block_s * share
    swings = state.unexplained > SWINGS * SWINGS and delay_s > SHORT_S
    too_long = state.unexplained > LEAST * LEAST and delay_s > BORNE_S
    explains = most > EXPLAINED and abs(share - 1.0) < OTHER_SHARE and state.moved > MOVED * state.unexplained
    state.explained_s = state.explained_s + block_s if explains and (swings or too_long) else 0.0
    if state.explained_s > SURE_S:
        state.found_s = max(state.found_s, delay_s)
        find(estimate, Finding.EFFORTS_LATE.value, 0, 1e3 * state.found_s, 1e3 * config.drive_ticks * config.period)
