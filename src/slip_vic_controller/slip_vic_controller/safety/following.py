"""A commanded motion that does not happen: friction of a joint above the effort, a brake, something in the way."""

from __future__ import annotations

from typing import Final

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
TURNED: Final = 256
"""Added to the joint where the pad is at its place and turned away from its reference."""
STUCK_NS: Final = 1_000_000_000
"""How long it must rest there [ns]."""


class Following(Record):
    """Whether the arm rests far from its reference."""

    since_ns: Whole  # NEVER = it does not
    joint: Whole  # the one on which the most torque has no effect; + TURNED where only its attitude is far
    error: Real  # m, with TURNED rad
    torque: Real  # N m; on that joint, beyond what the model needs at rest


FOLLOWING = dtype_of(Following)


@part
def stuck(state: Following, now_ns: int) -> bool:
    """Return whether the arm has not followed for long."""
    return bool(state.since_ns != NEVER and abs(state.torque) > LEAST_TORQUE and now_ns - state.since_ns > STUCK_NS)


@part
def watch_following(state: Following, n: int, arm: Arm, law: Evaluation, h: Array, effort: Array, now_ns: int) -> None:
    """Take down since when the arm rests far from its reference, and which joint has the most torque without effect.

    Args:
        state: changed.
        n: number of joints.
        arm, law: of this cycle.
        h: wrench on the pad {w}; (6,) [N, N m].
        effort: that the joints have; (n,) [N m].
        now_ns: the controller's clock.
    """
    away = law.error_linear > FAR
    if not (away or law.error_angular > FAR_TURNED) or vec(arm.twist).norm() > RESTS:
        state.since_ns = NEVER
        return
    if state.since_ns == NEVER:
        state.since_ns = now_ns
    state.error, state.torque = law.error_linear if away else law.error_angular, 0.0
    turned = 0 if away else TURNED
    for j in range(n):
        torque = effort[j] - arm.bias[j]
        for i in range(6):
            torque += arm.J[i, j] * h[i]
        if abs(torque) > abs(state.torque):
            state.joint, state.torque = j + turned, torque
