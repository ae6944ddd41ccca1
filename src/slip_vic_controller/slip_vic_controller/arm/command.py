"""The last step towards drives that take joint velocities or positions: from joint acceleration to a smooth command.

What law and HOLD want is a joint acceleration. It is integrated to a velocity, and that to a position, inside the
limits of velocity and acceleration, so that the drive can follow. By induction: a command that can come to rest inside
its limits stays one that can.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Final

import numpy as np

from slip_core.arrays import Array
from slip_core.cholesky import LARGEST, back_substitute, cholesky, forward_substitute
from slip_core.compiled import part
from slip_core.records import Real, Record, Whole, dtype_of
from slip_vic_controller.arm.estimator import LASTS_S, MOVES
from slip_vic_controller.sizes import MAX_JOINTS, Joints

LEAD: Final = 0.5
"""Most by which the commanded velocity may be ahead of the joint's, so that an arm that cannot follow is not thrown
when it can again [rad/s]."""
SHARE: Final = 0.5
"""Share of the acceleration limit with which a command brakes ahead of the end of a joint's range, and by which it may
change in a cycle: what limit avoidance switches on and off must not shake the arm."""
BEFORE_END: Final = 1e-3
"""How far before that end it comes to rest: periods make the brake late by less [rad]."""


@unique
class Interface(IntEnum):
    """What the drives of an arm take."""

    EFFORT = 0
    VELOCITY = 1
    POSITION = 2


class CommandLimits(Record):
    """Limits of commands, and how a runaway loop is detected."""

    interface: Whole  # Interface
    joints: Whole
    effort: Joints  # N m
    effort_rate: Real  # N m/s
    velocity: Joints  # rad/s
    acceleration: Joints  # rad/s^2
    lower: Joints  # rad, where a command is at rest; the joints' stops
    upper: Joints  # rad
    position_margin: Real  # rad; distance from the stops at which limit avoidance begins
    speed_linear: Real  # m/s; of the pad
    speed_angular: Real  # rad/s; of the pad
    longest_step_ns: Whole  # that counts between two commands
    restart_after_ns: Whole  # pause after which they start again
    period_ns: Whole  # of control
    lag_s: Real  # s; from a command to the motion that the joint state shows


class SentCommand(Record):
    """The command that left last, and when; its motion where the drives take velocities or positions."""

    started: Whole
    now_ns: Whole
    effort: Joints  # N m
    position: Joints  # rad
    velocity: Joints  # rad/s
    acceleration: Joints  # rad/s^2
    ignored_s: Joints  # s; for how long a joint has not moved so


SENT_COMMAND = dtype_of(SentCommand)


@part
def within_range(config: CommandLimits, joint: int, position: float) -> float:
    """Return a position [rad], held to the range of a joint: whatever is measured, no command is beyond its end."""
    return float(min(max(position, config.lower[joint]), config.upper[joint]))


@part
def start_motion(config: CommandLimits, state: SentCommand, q: Array, qd: Array) -> None:
    """Begin at the joint state; (n,) [rad], [rad/s]. A velocity beyond the limit begins at the limit."""
    for j in range(config.joints):
        most = config.velocity[j]
        state.position[j], state.acceleration[j] = within_range(config, j, q[j]), 0.0
        state.velocity[j] = min(max(qd[j], -most), most)
        state.ignored_s[j] = 0.0
    state.started = 1


@part
def joint_acceleration(n: int, M: Array, bias: Array, J: Array, h: Array, tau: Array, qdd: Array) -> bool:
    """Write the joint acceleration that an effort gives the modelled arm; False where there is none.

    qdd = M^-1 (tau + J^T h - bias). The wrench h is the one that went into tau, so its noise cancels.

    Args:
        n: number of joints.
        M: inertia (n, n) [kg m^2]; bias: C qd + g (n,) [N m]; J: Jacobian (6, n) {w}.
        h: wrench of the object on the robot (6,) [N, N m] {w}.
        tau: effort (n,) [N m].
        qdd: result (n,) [rad/s^2].

    Implements: Eq. (1), solved for the acceleration.
    """
    L = np.empty((n, n))
    if not cholesky(M[:n, :n], L):
        return False
    for j in range(n):
        total = tau[j] - bias[j]
        for i in range(6):
            total += J[i, j] * h[i]
        qdd[j] = total
    forward_substitute(L, qdd[:n], qdd[:n])
    back_substitute(L, qdd[:n], qdd[:n])
    return True


@part
def stopping_speed(distance: float, acceleration: float) -> float:
    """Return the largest speed that comes to rest within a distance: v^2 = 2 a d; [rad] -> [rad/s]."""
    return math.sqrt(2.0 * acceleration * max(distance, 0.0))


@part
def advance_motion(config: CommandLimits, state: SentCommand, qdd: Array, qd: Array, dt: float) -> None:
    """Integrate a joint acceleration over a time inside all limits; the result is `state`.

    Args:
        config, state: limits and last command.
        qdd: wanted (n,) [rad/s^2]; where one is not finite all joints come to rest instead.
        qd: measured or estimated (n,) [rad/s].
        dt: since the command before [s]; 0 changes nothing.
    """
    finite, T = True, dt
    for j in range(config.joints):
        finite = finite and abs(qdd[j]) <= LARGEST
    if dt <= 0.0:
        return
    for j in range(config.joints):
        v, most = state.velocity[j], config.acceleration[j]
        change = brake = SHARE * most
        wanted, before = qdd[j] if finite else -v / T, state.acceleration[j]
        ahead = state.position[j] + v * T  # what is decided now acts from there on
        up = min(config.velocity[j], stopping_speed(config.upper[j] - BEFORE_END - ahead, brake))
        down = min(config.velocity[j], stopping_speed(ahead - BEFORE_END - config.lower[j], brake))
        up, down = min(up, max(qd[j] + LEAD, 0.0)), min(down, max(LEAD - qd[j], 0.0))
        new = min(max(wanted, before - change), before + change) if finite else wanted  # at once to rest
        # The acceleration limit counts last: a jump of the others is no reason to jump.
        new = min(max(min(max(new, (-down - v) / T), (up - v) / T), -most), most)
        state.position[j] = within_range(config, j, state.position[j] + (v + 0.5 * new * T) * T)
        state.velocity[j], state.acceleration[j] = v + new * T, new


@part
def ignored_joint(config: CommandLimits, state: SentCommand, qd: Array, dt: float) -> int:
    """Return a joint that does not take commands, -1 where all do: its driver is paused, or something blocks it.

    Its velocity is off the commanded one by more than half of that and what the lag of the drive explains, for LASTS_S.
    Such a command would throw the arm when it counts again. qd: measured or estimated (n,) [rad/s]; dt: since the
    command before [s].
    """
    found = -1
    for j in range(config.joints):
        v = abs(state.velocity[j])
        explained = 0.5 * v + config.lag_s * abs(state.acceleration[j])
        ignored = v > MOVES and abs(qd[j] - state.velocity[j]) > explained
        state.ignored_s[j] = state.ignored_s[j] + dt if ignored else 0.0
        if state.ignored_s[j] > LASTS_S:
            found = j
    return found


@part
def return_to(config: CommandLimits, state: SentCommand, q: Array, dt: float) -> None:
    """Let the commanded positions come back to where the joints are (n,) [rad], at half of the speed limit."""
    for j in range(config.joints):
        most = 0.5 * config.velocity[j] * dt
        way = min(max(q[j] - state.position[j], -most), most)
        state.position[j] = within_range(config, j, state.position[j] + way)


@part
def stop_motion(config: CommandLimits, state: SentCommand, dt: float) -> None:
    """Bring the command to rest inside its limits; dt: since the command before [s]."""
    nowhere, before = np.full(MAX_JOINTS, np.nan), state.velocity.copy()
    state.ignored_s[:] = 0.0
    advance_motion(config, state, nowhere, before, dt)
    for j in range(config.joints):
        if abs(before[j]) <= config.acceleration[j] * dt:  # to the last bit
            state.velocity[j] = state.acceleration[j] = 0.0
