"""Friction learnt from the first slip of a run, and the reference governor's timing of that robot's path below it.

The governor is the one that runs in the controller, on the rigid contact model that it has: the calibrated lever,
inertia and torsional radius, all per mass. The weight is left out of its model: the grasp carries it all the time, and
95 % of a load that is mostly weight would not. What its timing would have done to the box is then simulated in the
calibrated soft grasp, with weight, swing and skin, which is no part of the governor.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import savgol_filter

from slip_core.arrays import Array
from test.referees.governor_bench import Friction, Governor
from tools.real_data import calibrate
from tools.real_data.detect import TICK_S, observed, rest_noise
from tools.real_data.grasp import values
from tools.real_data.predict import Prediction, predict
from tools.real_data.runs import RATE_HZ, PadMotion
from tools.real_data.soft_grasp import G
from tools.real_data.table import Run, read_table

ATTITUDE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Pad axes in the world: x along the path, y up, z the closing direction, which is level."""
KEPT = 0.95  # of the load that slipped, as the governor does
SMOOTHED = 21  # samples, of the path that is given to the governor
MOVED_M = 1e-3
MOST_CYCLES = 20_000


class Learnt(NamedTuple):
    """What the first slip of a run says."""

    run: str
    time: float  # s, of the detection
    acceleration: float  # m/s^2, the largest of the pads up to then
    friction: float  # N/kg, KEPT times the load of the motion that slipped
    with_weight: float  # the same of the whole load, over the weight; below 1 a governor with it refuses every path


class Timing(NamedTuple):
    """A path as it was run, and as the governor would run it."""

    learnt: Learnt
    planned_s: float
    governed_s: float
    governed: PadMotion
    predicted: Prediction


class Path1D:
    """A recorded path as the governor's bench asks for it: along world x, at rest at both ends."""

    def __init__(self, run: Run) -> None:
        grid = np.arange(run.time[0], run.time[-1], 1.0 / RATE_HZ)
        position = np.interp(grid, run.time, run.position)
        position = savgol_filter(position, SMOOTHED, 3)
        moving = np.flatnonzero((position > position[0] + MOVED_M) & (position < position[-1] - MOVED_M))
        first, last = moving[0], moving[-1]
        self.duration = float(grid[last] - grid[first])
        self.start = ATTITUDE
        self._spline = CubicSpline(grid[first : last + 1] - grid[first], position[first : last + 1], bc_type="clamped")

    def at(self, t: float) -> tuple[Array, Array, Array, Array]:
        """Return position (3,), attitude (3, 3), twist (6,) and acceleration (6,); {w}."""
        t = min(max(t, 0.0), self.duration)
        place, twist, acceleration = np.zeros(3), np.zeros(6), np.zeros(6)
        place[0], twist[0], acceleration[0] = (float(self._spline(t, k)) for k in range(3))
        return place, ATTITUDE, twist, acceleration


def contact(p: dict[str, float], friction: float, gravity: float = 0.0) -> SimpleNamespace:
    """Return the governor's model of the grasp, per mass."""
    return SimpleNamespace(
        mass=1.0,
        inertia=np.diag([p["gyration"] ** 2] * 3),
        r=p["lever"] * np.array([-np.sin(p["tilt"]), np.cos(p["tilt"]), 0.0]),
        radius=p["torsional_radius"],
        force=friction,
        axes=np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        gravity=np.array([0.0, 0.0, -gravity]),
    )


def learn(run: Run, others: list[Run], p: dict[str, float]) -> Learnt | None:
    """Return the friction that the first slip of a run shows, None where the observer finds none."""
    found = observed(run, rest_noise(others))
    if not found:
        return None
    until = found[0][0]
    a = run.acceleration[run.time <= until]
    largest = float(a[np.argmax(np.abs(a))])
    motion = np.array([largest, 0.0, 0.0, 0.0, 0.0, 0.0])
    loads = []
    for gravity in (0.0, G):
        bench = Governor(Path1D(run), contact(p, G, gravity), dt=TICK_S, estimator=Friction.KNOWN)
        loads.append(KEPT * float(np.linalg.norm(bench.load_of(ATTITUDE, np.zeros(3), motion))))
    return Learnt(run.name, until, largest, loads[0], loads[1] / G)


def govern(run: Run, learnt: Learnt, p: dict[str, float]) -> Timing:
    """Run a recorded path through the governor below a friction that was learnt, then through the calibrated grasp."""
    path = Path1D(run)
    bench = Governor(path, contact(p, learnt.friction), dt=TICK_S, estimator=Friction.KNOWN)
    bench.plan()
    places = []
    for _ in range(MOST_CYCLES):
        place, R, _, a = bench.before()
        bench.after(a, a, R, np.zeros(3))
        places.append(place[0])
        if bench.state.arrived:
            break
    governed_s = TICK_S * len(places)
    before, after = np.full(round(1.0 / TICK_S), places[0]), np.full(round(1.0 / TICK_S), places[-1])
    position = np.concatenate([before, places, after])
    fine = TICK_S * np.arange(position.size)
    t = np.arange(0.0, fine[-1], 1.0 / RATE_HZ)
    s = np.interp(t, fine, position)
    pads = PadMotion(t, s, *(savgol_filter(s, 11, 3, deriv=k, delta=1.0 / RATE_HZ) for k in (1, 2)))
    return Timing(learnt, path.duration, governed_s, pads, predict(pads, calibrate.read()[0]))


def timings() -> list[Timing]:
    """Return the timings of the path of the slowest run that lost the object, for the first slip of every run."""
    runs = read_table()
    lost = next(run for run in runs if not run.kept)
    p = values(calibrate.read()[0].standard[0])
    found = []
    for run in runs:
        learnt = learn(run, [other for other in runs if other is not run], p)
        if learnt is not None:
            found.append(govern(lost, learnt, p))
    return found


def table(found: list[Timing]) -> list[str]:
    """Return the lines of the table."""
    lines = [
        "| first slip of | at s | acceleration m/s^2 | 95 % of the whole load / weight | path s | governed s | slower |"
        " largest acceleration m/s^2 | kept (P) | rotation deg, 80 % |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for one in found:
        j = one.predicted.json()
        cells = [
            one.learnt.run, f"{one.learnt.time:.2f}", f"{one.learnt.acceleration:.2f}",
            f"{one.learnt.with_weight:.2f}", f"{one.planned_s:.2f}", f"{one.governed_s:.2f}",
            f"{100.0 * (one.governed_s / one.planned_s - 1.0):.0f} %",
            f"{np.abs(one.governed.acceleration).max():.2f}",
            f"{'kept' if j['kept'] else 'lost'} ({one.predicted.probability_kept:.2f})",
            f"{j['min_deg_80'][0]:.1f} to {j['max_deg_80'][1]:.1f}",
        ]  # fmt: skip
        lines.append(f"| {' | '.join(cells)} |")
    return lines
