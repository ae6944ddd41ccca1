"""A commanded motion that does not happen: friction of a joint, a brake, something in the way."""

from __future__ import annotations

from typing import Final

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.vectors import vec
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.law.evaluation import Evaluation
from slip_vic_controller.safety.conditions import NOTHING, Reason, Why

FAR, FAR_TURNED = 0.01, 0.05
"""Distance from the reference at which an arm that rests does not follow it [m], [rad]."""
LEAST_TORQUE: Final = 0.05
"""Torque without effect that is friction: an object of another weight balances an arm far off, too [N m]."""
RESTS: Final = 1e-3
"""Speed of a pad that rests [m/s]."""


@part
def rests_far_off(law: Evaluation, twist: Array) -> bool:
    """Return whether the pad rests far from its reference; twist: of the pad {w} (6,) [m/s, rad/s]."""
    far = law.error_linear > FAR or law.error_angular > FAR_TURNED
    return bool(far and vec(twist).norm() <= RESTS)


@part
def what_keeps(n: int, arm: Arm, law: Evaluation, h: Array, effort: Array, commanded: Array) -> Why:
    """Return which joint keeps an arm far from its reference, NOTHING where the torques are balanced.

    It is the one that the fastest command does not move, or with drives that take efforts most torque: inertia couples
    the joints, so that the largest torque need not be that of the blocked one.

    Args:
        n: number of joints.
        arm, law: of this cycle.
        h: wrench on the pad {w}; (6,) [N, N m].
        effort: that the joints have; (n,) [N m].
        commanded: velocities that drives with loops of their own are commanded; (n,) [rad/s], of others zeros.
    """
    joint, unmoved, most = 0, 0.0, -1.0
    for j in range(n):
        torque = effort[j] - arm.bias[j]
        for i in range(6):
            torque += arm.J[i, j] * h[i]
        against = abs(commanded[j]) if commanded.any() else abs(torque)
        if against > most:
            most, joint, unmoved = against, j, torque
    error = law.error_linear if law.error_linear > FAR else law.error_angular
    found = Why(Reason.NOT_FOLLOWING.value, 0, 0, joint, unmoved, error)
    return found if abs(unmoved) > LEAST_TORQUE else NOTHING
