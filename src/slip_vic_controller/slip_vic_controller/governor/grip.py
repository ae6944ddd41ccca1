"""Grip as the other output: squeeze as hard as the path ahead needs, and no harder.

    N_des = max over the preview of |l(a_d)| / (margin mu),   mu = F^ / N_told

A gripper is slow, so the load is previewed on the planned path, and the command changes no faster than the configured
rate. The gripper is not measured: a lag of first order stands for it, and F^
grows and shrinks with that.
"""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.records import Real, Record, Records, Whole
from slip_vic_controller.governor.plan import GRID_POINTS, GridPoint


class GripConfig(Record):
    """How the grip may be commanded."""

    follow: Whole  # whether it is commanded
    nominal_force: Real  # N, for which friction is configured; never less than this
    force_limit: Real  # N
    command_rate: Real  # N/s
    lag_s: Real  # s, of the gripper
    preview_s: Real  # s
    margin: Real  # share of friction that the load may take


class Grip(Record):
    """The grip as it is commanded and modelled."""

    command: Real  # N
    actual: Real  # N, what the gripper is taken to hold with


@part
def load_ahead(grid: Records[GridPoint], time: float, preview_s: float) -> float:
    """Return the largest load of the path as it is planned, from a time of it on [N].

    Args:
        grid: points of the path, planned.
        time: of the user's path, now [s].
        preview_s: how far ahead [s].
    """
    first = 0
    while first < GRID_POINTS - 2 and grid[first + 1].time <= time:
        first += 1
    most = 0.0
    for i in range(first, GRID_POINTS):
        point = grid[i]
        if i > first and point.time > time + preview_s:
            break
        x, u = point.K, 0.0
        if i + 1 < GRID_POINTS and grid[i + 1].s > point.s:
            u = 0.5 * (grid[i + 1].K - x) / (grid[i + 1].s - point.s)
        square = (point.uu * u + 2.0 * (point.ux * x + point.uc)) * u + (point.xx * x + 2.0 * point.xc) * x + point.cc
        most = max(most, square)
    return math.sqrt(most)


@part
def follow_load(config: GripConfig, grip: Grip, load: float, F_nominal: float, dt: float) -> None:
    """Move the command towards what a load needs, and the gripper towards its command.

    Args:
        config, grip: parameters and state of the grip.
        load: that friction must carry [N].
        F_nominal: friction limit at the nominal grip [N].
        dt: since the cycle before [s].
    """
    wanted = min(
        max(load * config.nominal_force / (config.margin * F_nominal), config.nominal_force), config.force_limit
    )
    share = 1.0 - math.exp(-dt / config.lag_s) if config.lag_s > 0.0 else 1.0
    grip.actual += share * (grip.command - grip.actual)
    most = config.command_rate * dt
    grip.command = min(max(wanted, grip.command - most), grip.command + most)
