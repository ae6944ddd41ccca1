"""Limit avoidance, then the effort limiter: the one last step that every command passes.

Limit avoidance adds torques that keep joints from their stops and limit speeds. The effort limiter lets out what is
finite, inside the effort limits and no faster than the rate limit. By induction: the effort before is finite and inside
the limits, so what comes out is too, whatever was wanted.
"""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_core.cholesky import all_finite, cholesky, forward_substitute
from slip_core.compiled import part
from slip_core.records import WholeArray
from slip_vic_controller.arm.command import CommandLimits, SentCommand
from slip_vic_controller.sizes import MAX_JOINTS

BRAKE_LAG_S = 0.020
"""Largest delay of efforts with which a braked joint does not reverse [s]; HOLD tolerates as much."""
BRAKE_SHARE, TRIP_SHARE = 0.9, 1.5
"""Share of its velocity limit at which a joint is braked, and of its limit at which the speed of a joint or a pad is a
fault: a control loop that runs away ends here."""
LONGEST_STEP_S = 0.005
"""Time between two commands that the rate limit counts at most, so that a pause allows no jump [s]."""
HELD = 0.2
"""Share of the effort limit by which the measured effort may be off gravity: an object, friction, a wrong model."""

# -- limit avoidance ----------------------------------------------------------------------------------


@part
def most_brake(limits: CommandLimits, speed: float, inertia: float) -> float:
    """Return the largest torque that brakes a joint and does not turn it round [N m]; [rad/s], [kg m2].

    A braking effort stays in effect for one more period and BRAKE_LAG_S, together T, and then for as long as the rate
    limit takes to bring it down to zero: tau T + tau^2 / (2 rate) = inertia * speed / 2. Half, because another joint
    may brake the same motion. With more a joint that is light for its motor is pushed to and fro without end.
    """
    T = 1e-9 * limits.period_ns + BRAKE_LAG_S
    return float(limits.effort_rate * (math.sqrt(T * T + inertia * speed / limits.effort_rate) - T))


@part
def felt_inertias(M: Array, n: int, felt: Array) -> None:
    """Write the inertia that each motor turns while all other joints yield to `felt` (n,): 1 / (M^-1)_jj [kg m2].

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
def avoid_limits(limits: CommandLimits, q: Array, qd: Array, M: Array, torque: Array) -> None:
    """Add the torques of limit avoidance to `torque` (n,) [N m]; q, qd: (n,); M: inertia, zeros where unknown."""
    n, fast, felt = limits.joints, False, np.zeros(MAX_JOINTS)
    for j in range(n):
        fast = fast or abs(qd[j]) > BRAKE_SHARE * limits.velocity[j]
    if fast:
        felt_inertias(M, n, felt)
    for j in range(n):
        torque[j] = torque[j] + joint_repulsion(limits, j, q[j], qd[j], felt[j])


# -- effort limiter -----------------------------------------------------------------------------------


@part
def start_limiter(limits: CommandLimits, state: SentCommand, measured: Array, gravity: Array, now_ns: int) -> None:
    """Set the effort from which the first command, also after a pause, is limited; (n,) [N m].

    The measured effort is what the joints feel now, so a restart makes no torque step; no farther from gravity
    compensation than HELD, as drivers publish currents, too. Where there is none (not finite, or all zero, which a
    driver without torque sensors publishes) it is gravity compensation. The first step counts one control period.
    """
    felt = measured[: limits.joints]
    known = bool(all_finite(felt) and felt.any())
    for j in range(limits.joints):
        limit, start = limits.effort[j], gravity[j]
        if known:
            start = min(max(felt[j], start - HELD * limit), start + HELD * limit)
        state.effort[j] = min(max(start, -limit), limit)
    state.started, state.now_ns = 1, now_ns - limits.period_ns


@part
def needs_restart(limits: CommandLimits, state: SentCommand, now_ns: int) -> bool:
    """Return whether the last command is so old that the joints may feel something else by now."""
    return bool(state.started == 0 or now_ns - state.now_ns > limits.restart_after_ns)


@part
def limit_effort(limits: CommandLimits, state: SentCommand, wanted: Array, now_ns: int, clipped: WholeArray) -> bool:
    """Let an effort out: finite, clipped, slope-limited, in this order; the result is `state.effort`.

    Args:
        limits, state: of the limiter; state is changed.
        wanted: (n,) [N m].
        now_ns: the controller's clock.
        clipped: result; which joints were clipped or limited in rate; (n,) 0 or 1.

    Returns:
        Whether `wanted` was finite; if not, the last effort goes out again.
    """
    finite = all_finite(wanted[: limits.joints])
    # The same slope at every control rate; a clock that goes back allows no step.
    step = limits.effort_rate * 1e-9 * min(max(now_ns - state.now_ns, 0), limits.longest_step_ns)
    for j in range(limits.joints):
        limit, before = limits.effort[j], state.effort[j]
        torque = wanted[j] if finite else before
        inside = min(max(torque, -limit), limit)
        effort = min(max(inside, before - step), before + step)
        # Where the rate does not bind this is `inside` to the last bit. Rounding may not carry it over the limit.
        effort = min(max(effort, -limit), limit)
        clipped[j] = 1 if effort != torque else 0
        state.effort[j] = effort
    state.now_ns = max(now_ns, state.now_ns)
    return finite
