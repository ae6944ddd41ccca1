"""A commanded motion that does not happen: friction of a joint, a brake, something in the way, the end of a range."""

from __future__ import annotations

from typing import Final, Protocol

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Whole, dtype_of
from slip_core.vectors import vec
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.law.law import Evaluation
from slip_vic_controller.sizes import NEVER

FAR, FAR_TURNED = 0.01, 0.05
"""Distance from the reference at which an arm that rests does not follow it [m], [rad]."""
LEAST_TORQUE: Final = 0.05
"""Torque without effect that is friction: an object of another weight balances an arm far off, too [N m]."""
RESTS: Final = 1e-3
"""Speed of a pad that rests [m/s]."""
LEAST_COMMAND: Final = 1e-6
"""Commanded velocity that counts as much as 1 N m: with drives that take velocities the command alone [rad/s/(N m)]."""
TURNED: Final = 256
"""Added to the joint where the pad is at its place and turned away from its reference."""
AT_END: Final = 512
"""Added to the joint that limit avoidance keeps from the end of its range."""
STUCK_NS: Final = 1_000_000_000
"""How long it must rest there [ns]."""


class RangeEnds(Protocol):
    """Where limit avoidance begins to keep joints from their stops (n,) [rad]."""

    near_lower: Array
    near_upper: Array


class Following(Record):
    """Whether the arm rests far from its reference."""

    since_ns: Whole  # NEVER = it does not
    joint: Whole  # the one on which the most torque has no effect; + TURNED where only its attitude is far, + AT_END
    error: Real  # m, with TURNED rad
    torque: Real  # N m; on that joint, beyond what the model needs at rest; with AT_END its position, rad


FOLLOWING = dtype_of(Following)


@part
def stuck(state: Following, now_ns: int) -> bool:
    """Return whether the arm has not followed for long."""
    prevented = state.joint >= AT_END or abs(state.torque) > LEAST_TORQUE
    return bool(state.since_ns != NEVER and prevented and now_ns - state.since_ns > STUCK_NS)


@part
def watch_following(
    state: Following, limits: RangeEnds, n: int, q: Array, twist: Array, arm: Arm, law: Evaluation, h: Array,
    effort: Array, commanded: Array, now_ns: int,
) -> None:  # fmt: skip
    """Take down since when the arm rests far from its reference, and which joint keeps it there.

    That is a joint near the end of its range; else the one that most torque, or the fastest command, does not move.

    Args:
        state: changed.
        limits: where limit avoidance begins.
        n: number of joints.
        q: joint positions (n,) [rad].
        twist: of the pad as it moves {w}; (6,) [m/s, rad/s].
        arm, law: of this cycle.
        h: wrench on the pad {w}; (6,) [N, N m].
        effort: that the joints have; (n,) [N m].
        commanded: velocities that drives with loops of their own are commanded; (n,) [rad/s], of others zeros.
        now_ns: the controller's clock.
    """
    away = law.error_linear > FAR
    if not (away or law.error_angular > FAR_TURNED) or vec(twist).norm() > RESTS:
        state.since_ns = NEVER
        return
    if state.since_ns == NEVER:
        state.since_ns = now_ns
    state.error = law.error_linear if away else law.error_angular
    turned, most, deepest = 0 if away else TURNED, -1.0, 0.0
    for j in range(n):
        torque = effort[j] - arm.bias[j]
        for i in range(6):
            torque += arm.J[i, j] * h[i]
        against = abs(commanded[j]) + abs(torque) * LEAST_COMMAND
        if against > most:
            most, state.joint, state.torque = against, j + turned, torque
    for j in range(n):
        depth = max(limits.near_lower[j] - q[j], q[j] - limits.near_upper[j])
        if depth > deepest:
            deepest, state.joint, state.torque = depth, j + turned + AT_END, q[j]
