"""Limit avoidance: torques that keep joints from their stops and limit speeds, before the effort limiter."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_core.cholesky import cholesky, forward_substitute
from slip_core.compiled import part
from slip_vic_controller.arm.command import CommandLimits
from slip_vic_controller.sizes import MAX_JOINTS

BRAKE_LAG_S = 0.020
"""How late efforts may be at work without a braked joint being thrown to the other side [s]; HOLD bears as much."""
BRAKE_SHARE, TRIP_SHARE = 0.9, 1.5
"""Share of its velocity limit at which a joint is braked, and of its limit at which the speed of a joint or a pad is a
fault: a control loop that runs away ends here."""


@part
def pushed_joint(limits: CommandLimits, n: int, q: Array) -> int:
    """Return the joint that is deepest in what its stops keep it from, -1 where none is; q (n,) [rad]."""
    pushed, deepest = -1, 0.0
    for j in range(n):
        depth = limits.position_margin - min(q[j] - limits.lower[j], limits.upper[j] - q[j])
        if depth > deepest:
            pushed, deepest = j, depth
    return pushed


@part
def most_brake(limits: CommandLimits, speed: float, inertia: float) -> float:
    """Return the largest torque that brakes a joint and does not turn it round [N m]; [rad/s], [kg m2].

    What brakes now is at work for one more period and BRAKE_LAG_S, together T, and then for as long as the rate limit
    takes to bring it down to zero: tau T + tau^2 / (2 rate) = inertia * speed / 2. Half, because another joint may
    brake the same motion. With more a joint that is light for its motor is pushed to and fro without end.
    """
    T = 1e-9 * limits.period_ns + BRAKE_LAG_S
    return float(limits.effort_rate * (math.sqrt(T * T + inertia * speed / limits.effort_rate) - T))


@part
def felt_inertias(M: Array, n: int, felt: Array) -> None:
    """Write what each motor has to turn while all other joints give way to `felt` (n,): 1 / (M^-1)_jj [kg m2].

    Two joints whose axes are nearly one turn against each other almost freely, though both diagonals of M are large.
    Writes nothing where M is not positive definite.
    """
    L, x = np.zeros((n, n)), np.empty(n)
    if not cholesky(M[:n, :n], L):
        return
    for j in range(n):
        x[:] = 0.0
        x[j] = 1.0
        forward_substitute(L, x, x)
        total = 0.0
        for k in range(j, n):
            total += x[k] * x[k]
        felt[j] = 1.0 / total


@part
def joint_repulsion(limits: CommandLimits, j: int, q: float, qd: float, inertia: float) -> float:
    """Return the torque of joint j away from its stops and against too high a velocity [N m].

    Grows from zero with the square of the depth, to the full effort at the stop, and in proportion from the braking
    velocity on, to the full effort at the velocity limit, or to `most_brake`: continuous, bounded, no gains to tune.
    """
    speed, from_speed = abs(qd), BRAKE_SHARE * limits.velocity[j]
    margin = limits.position_margin
    low = min(max((limits.lower[j] + margin - q) / margin, 0.0), 1.0)
    high = min(max((q - (limits.upper[j] - margin)) / margin, 0.0), 1.0)
    share = min(max((speed - from_speed) / (limits.velocity[j] - from_speed), 0.0), 1.0)
    brake = min(limits.effort[j] * share, most_brake(limits, speed, inertia))
    return limits.effort[j] * (low * low - high * high) - math.copysign(brake, qd)


@part
def avoid_limits(limits: CommandLimits, n: int, q: Array, qd: Array, M: Array, torque: Array) -> None:
    """Add the torques of limit avoidance to `torque` (n,) [N m]; q, qd: (n,); M: inertia, zeros where unknown."""
    fast, felt = False, np.zeros(MAX_JOINTS)
    for j in range(n):
        fast = fast or abs(qd[j]) > BRAKE_SHARE * limits.velocity[j]
    if fast:
        felt_inertias(M, n, felt)
    for j in range(n):
        torque[j] = torque[j] + joint_repulsion(limits, j, q[j], qd[j], felt[j])
