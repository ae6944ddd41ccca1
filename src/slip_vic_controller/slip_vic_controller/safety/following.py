"""A commanded motion that does not happen: friction of a joint, a brake, something in the way, the end of a range."""

from __future__ import annotations

from typing import Final

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Whole, dtype_of
from slip_core.vectors import vec
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.law.law import Evaluation
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.safety.limit_avoidance import RangeEnds, pushed_joint
from slip_vic_controller.sizes import NEVER

FAR, FAR_TURNED = 0.01, 0.05
"""Distance from the reference at which an arm that comes no nearer does not follow it [m], [rad]."""
NEARER: Final = 0.9
"""Share of that distance at which it has come nearer."""
LEAST_TORQUE: Final = 0.05
"""Torque without effect that is friction: an object of another weight balances an arm far off, too [N m]."""
RESTS: Final = 1e-3
"""Speed of a pad or a reference that rests [m/s]."""
STUCK_NS: Final = 1_000_000_000
"""How long it must stay there [ns]."""


class Following(Record):
    """Whether the arm stays far from its reference."""

    since_ns: Whole  # NEVER = it does not
    cause: Whole  # NOT_FOLLOWING or RANGE_END; NOT_TURNING or RANGE_END_TURNED where only its attitude is far
    joint: Whole  # that keeps it there
    value: Real  # of that joint; unit: see Reason
    error: Real  # largest distance from the reference since then; unit: see Reason


FOLLOWING = dtype_of(Following)


@part
def stuck(state: Following, now_ns: int) -> bool:
    """Return whether the arm has not followed for long."""
    at_end = state.cause == Reason.RANGE_END or state.cause == Reason.RANGE_END_TURNED
    prevented = at_end or abs(state.value) > LEAST_TORQUE
    return bool(state.since_ns != NEVER and prevented and now_ns - state.since_ns > STUCK_NS)


@part
def stays_far(state: Following, twist: Array, reference: Array, law: Evaluation, now_ns: int) -> bool:
    """Return whether the arm stays far from its reference, and take down since when.

    It stays where it rests, and where it comes no nearer to a reference that rests: an arm may sway there.

    Args:
        state: changed.
        twist, reference: of the pad as it moves, and of its reference {w}; (6,) [m/s, rad/s].
        law: of this cycle.
        now_ns: the controller's clock.
    """
    away = law.error_linear > FAR
    rests = vec(twist).norm() <= RESTS or vec(reference).norm() <= RESTS
    if not (away or law.error_angular > FAR_TURNED) or not rests:
        state.since_ns = NEVER
        return False
    error = law.error_linear if away else law.error_angular
    if state.since_ns == NEVER or error < NEARER * state.error:
        state.since_ns, state.error = now_ns, error
    state.error = max(state.error, error)
    return True


@part
def find_what_keeps(
    state: Following, limits: RangeEnds, n: int, q: Array, arm: Arm, law: Evaluation, h: Array, effort: Array,
    commanded: Array,
) -> None:  # fmt: skip
    """Take down which joint keeps an arm far from its reference.

    It is one near the end of its range; else the one that the fastest command does not move, or with drives that take
    efforts most torque: inertia couples the joints, so that the largest torque need not be that of the blocked one.

    Args:
        state: changed.
        limits: where limit avoidance begins.
        n: number of joints.
        q: joint positions (n,) [rad].
        arm, law: of this cycle.
        h: wrench on the pad {w}; (6,) [N, N m].
        effort: that the joints have; (n,) [N m].
        commanded: velocities that drives with loops of their own are commanded; (n,) [rad/s], of others zeros.
    """
    away, most = law.error_linear > FAR, -1.0
    state.cause = Reason.NOT_FOLLOWING.value if away else Reason.NOT_TURNING.value
    for j in range(n):
        torque = effort[j] - arm.bias[j]
        for i in range(6):
            torque += arm.J[i, j] * h[i]
        against = abs(commanded[j]) if commanded.any() else abs(torque)
        if against > most:
            most, state.joint, state.value = against, j, torque
    pushed = pushed_joint(limits, n, q)
    if pushed >= 0:
        state.cause = Reason.RANGE_END.value if away else Reason.RANGE_END_TURNED.value
        state.joint, state.value = pushed, q[pushed]
