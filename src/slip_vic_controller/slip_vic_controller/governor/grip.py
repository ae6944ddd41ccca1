"""The grip as a second output: squeeze only as hard as the load ahead needs.

    N = (L + eps) / (mu r),   L = max(p, |l| - noise, 0.9 d) + what the plan rises by within the preview

mu: configured friction, r: the fraction of it that is certain by the belief; p, l, d: see `contact.belief`; eps: the
load that is probed anyway. The command rises at once and falls slowly. While the object slips it does not fall: the
measured load does, and a squeeze that followed it would lose the object. The gripper is not measured, but
modelled by a first-order lag and its smallest force for a command.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Final

from slip_core.compiled import part
from slip_core.records import Real, Record, Records, Whole
from slip_vic_controller.contact.belief import BELIEF_TUNING, Belief
from slip_vic_controller.governor.plan import GRID_POINTS, GridPoint

SINKS_S: Final = 0.02
"""Time constant with which the command falls to what the load needs, or grows in a slip; also the preview of the load
beyond the gripper's lag [s]."""


@unique
class Handover(IntEnum):
    """Reaction to a hand that pulls at the object."""

    HOLD = 0
    FOLLOW = 1
    OPEN = 2


class GripConfig(Record):
    """Limits of the grip command."""

    follow: Whole  # whether it is commanded
    nominal_force: Real  # N, for which friction is configured
    least_force: Real  # N
    cap: Real  # N
    error_force: Real  # N, by which the force may be less than commanded
    risk: Real  # probability that friction carries less than is taken as certain
    lag_s: Real  # s, of the gripper
    preview_s: Real  # s


class Grip(Record):
    """The commanded and the modelled grip."""

    command: Real  # N
    actual: Real  # N, what the gripper is taken to hold with
    opens: Whole  # whether it was opened for a hand, until the law begins again


@part
def load_ahead(grid: Records[GridPoint], time: float, preview_s: float) -> float:
    """Return by how much the planned load rises from a time on the path [N].

    Args:
        grid: points of the path, planned.
        time: of the user's path, now [s].
        preview_s: how far ahead [s].
    """
    first = 0
    while first < GRID_POINTS - 2 and grid[first + 1].time <= time:
        first += 1
    now = most = 0.0
    for i in range(first, GRID_POINTS):
        point = grid[i]
        if i > first + 1 and point.time > time + preview_s:
            break
        x, u = point.K, 0.0
        if i + 1 < GRID_POINTS and grid[i + 1].s > point.s:
            u = 0.5 * (grid[i + 1].K - x) / (grid[i + 1].s - point.s)
        square = (point.uu * u + 2.0 * (point.ux * x + point.uc)) * u + (point.xx * x + 2.0 * point.xc) * x + point.cc
        now = square if i == first else now
        most = max(most, square)
    return math.sqrt(most) - math.sqrt(now)


@part
def load_to_hold(belief: Belief, commanded: float) -> float:
    """Return the load to carry now [N]: never only the measured one, which falls in a slip."""
    tuning = BELIEF_TUNING
    return max(belief.needed, belief.carried - tuning.counts * belief.noise, tuning.stands * commanded)


@part
def squeeze(config: GripConfig, grip: Grip, needed: float, slips: bool, slides: bool, dt: float) -> None:
    """Move the command towards what a load needs, and the gripper towards its command.

    Args:
        config, grip: parameters and state of the grip.
        needed: squeeze that carries the load [N].
        slips: whether the contact is found to slip; the command does not fall then.
        slides: whether the object is believed to slide; the command grows then.
        dt: since the cycle before [s].
    """
    share = 1.0 - math.exp(-dt / config.lag_s) if config.lag_s > 0.0 else 1.0
    held = max(grip.command - config.error_force, config.least_force)
    grip.actual += share * (held - grip.actual)
    wanted = min(max(needed + config.error_force, config.least_force), config.cap)
    kept = math.exp(-dt / SINKS_S)
    falls = 1.0 if slips else kept
    moved = grip.command / kept if slides else wanted + falls * (grip.command - wanted)
    grip.command = kept * grip.command if grip.opens != 0 else min(max(wanted, moved), config.cap)
