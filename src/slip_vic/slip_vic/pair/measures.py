"""What a run with two arms is judged by, from the simulation's truth alone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rich.table import Table

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_sim_bridge.internal import internal_wrenches
from slip_sim_bridge.plant import DivergenceError
from slip_vic.pair.inprocess import TeamTick, run_pair
from slip_vic.pair.scenario import PairScenario
from slip_vic_controller.safety.modes import Mode

LOST_SLIP_M = 0.03
"""Slip at which a pad has left the pane: it reaches 20 mm over the edge."""
LOST_PATH_M = 0.5
SETTLE_S = 0.5
"""Time at the end over which the internal force counts as steady."""


@dataclass(frozen=True, slots=True)
class Judged:
    """One run. outcome: ok, lost (a pad or the path), fault (a mode), diverged; reason: when and why.

    slip: largest of each pad [m]; internal: largest internal force in the slip plane, both pads, and in the last half
    second [N]; load: largest share of the friction limit of each pad; path: largest distance of the object from its
    reference [m].
    """

    outcome: str
    reason: str
    slip: tuple[float, float]
    internal: float
    steady: float
    load: tuple[float, float]
    path: float


def verdicts(title: str, judged: Mapping[str, Judged]) -> Table:
    """Return the table of some runs of a scenario, by the name of the law."""
    table = Table(title=title)
    for name in ("law", "slip mm", "internal N", "steady N", "load", "path mm", "outcome"):
        table.add_column(name, justify="left" if name in ("law", "outcome") else "right")
    for law, found in judged.items():
        table.add_row(
            law, "/".join(f"{1e3 * s:.3f}" for s in found.slip), f"{found.internal:.3f}", f"{found.steady:.3f}",
            "/".join(f"{x:.2f}" for x in found.load), f"{1e3 * found.path:.1f}",
            found.outcome if found.outcome == "ok" else f"{found.outcome}: {found.reason}",
        )  # fmt: skip
    return table


COLUMNS = ("time_s", "slip_left_m", "slip_right_m", "internal_n", "moment_n_m", "load_left", "load_right", "path_m")
"""What `judge` can keep of every tick: slip, internal force in the slip plane and moment about the normal (the larger
of both pads), share of the friction limit, distance of the object from its reference."""


def judge(scenario: PairScenario, late_ticks: int = 0, series: list[tuple[float, ...]] | None = None) -> Judged:
    """Run a scenario in this process and judge it; ends where the pane is lost.

    Args:
        scenario: what runs.
        late_ticks: control periods that every command is on its way.
        series: takes a row of `COLUMNS` for every tick.
    """
    watch = _Watch(scenario, series)
    try:
        for tick in run_pair(scenario, late_ticks):
            watch.look(tick)
            if watch.outcome != "ok":
                break
    except DivergenceError as error:
        watch.outcome, watch.reason = "diverged", str(error)
    return Judged(
        watch.outcome, watch.reason, (watch.slip[0], watch.slip[1]), watch.internal, watch.steady,
        (watch.load[0], watch.load[1]), watch.path,
    )  # fmt: skip


class _Watch:
    """Sums a run up as it goes."""

    def __init__(self, scenario: PairScenario, series: list[tuple[float, ...]] | None) -> None:
        self._series = series
        left = scenario.controllers[0].contacts
        self._lever = matrix_from_quat_xyzw(left.orientation_xyzw[:4]).T @ np.array(left.position[:3])
        self._arms = tuple(scenario.bridges.values())
        self._radius = self._arms[0].friction.torsional_radius
        self._sag: Array | None = None
        self._steady_from = self._arms[0].duration_s - SETTLE_S
        self.outcome, self.reason = "ok", ""
        self.slip, self.load = [0.0, 0.0], [0.0, 0.0]
        self.internal = self.steady = self.path = 0.0

    def look(self, tick: TeamTick) -> None:
        """Take one tick in."""
        now, readings = 1e-9 * tick.outputs.stamp_ns, [arm.readings for arm in tick.outputs.arms]
        truth = readings[0].truth
        slips, loads, off = [0.0, 0.0], [0.0, 0.0], 0.0
        for side, reading in enumerate(readings):
            arm, h = self._arms[side], reading.wrench.wrench
            slips[side] = float(np.linalg.norm(reading.truth.slip_displacement[:3]))
            load = math.sqrt(h[0] * h[0] + h[1] * h[1] + (h[5] / self._radius) ** 2)
            loads[side] = load / (arm.friction.mu_s * arm.grip.force)
            self.slip[side] = max(self.slip[side], slips[side])
            self.load[side] = max(self.load[side], loads[side])
        wrenches = [reading.wrench.wrench for reading in readings]
        places, attitudes = zip(*(reading.pad for reading in readings), strict=True)
        _, parts = internal_wrenches(wrenches, places, attitudes, truth.position, self._radius)
        size = max(float(np.linalg.norm(part[:2])) for part in parts)
        self.internal = max(self.internal, size)
        if now >= self._steady_from:
            self.steady = max(self.steady, size)
        record = tick.results[0].record
        if record.ok:
            wanted = record.reference.position - record.reference.rotation @ self._lever
            if self._sag is None:
                self._sag = truth.position - wanted
            off = float(np.linalg.norm(truth.position - wanted - self._sag))
            self.path = max(self.path, off)
        if self._series is not None:
            moment = max(abs(float(part[5])) for part in parts)
            self._series.append((now, *slips, size, moment, *loads, off))
        for side, result in enumerate(tick.results):
            if result.mode == Mode.FAULT:
                self.outcome, self.reason = "fault", f"{now:.3f} s, {('left', 'right')[side]}: {result.reason}"
        if not max(self.slip) < LOST_SLIP_M:
            self.outcome, self.reason = "lost", f"{now:.3f} s: a pad has slid {1e3 * max(self.slip):.0f} mm"
        if not self.path < LOST_PATH_M:
            self.outcome, self.reason = "lost", f"{now:.3f} s: the pane is {self.path:.2f} m off its path"
