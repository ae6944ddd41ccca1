"""Slip detectors on recorded runs, learnt from the other runs and scored against the marker.

True slip is what the marker shows: the object turns in the pads faster than TRUE_DEG_S for SHORTEST_S or longer. Three
detectors, none of which looks ahead:
- the slip observer of the controller, fed with marker readings at their rate and with no wrench, since counts of the
  skin are not newtons: its prediction is that the object goes with the pads;
- the twist of the shear field alone: it changes faster than a threshold;
- the load of the shear field along the path alone: it exceeds a threshold.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from slip_core.arrays import Array
from slip_core.compiled import IN1, OUT1, OUT2, VOID, kernel
from slip_core.params import build
from slip_core.records import new, record, records
from slip_vic_controller.config.observer import capacity, observer_config
from slip_vic_controller.contact.observer import MOTION, OBSERVER, OBSERVER_CONFIG, ROW_SIZE, observe, reset
from slip_vic_controller.law.contact import SLIP_SAMPLE
from slip_vic_controller.params.controller_params import ControllerParams
from tools.real_data.runs import RATE_HZ
from tools.real_data.table import Run, read_table

TRUE_DEG_S, SHORTEST_S, MERGED_S = 8.0, 0.05, 0.1
WINDOW, DEGREE = 9, 2  # of the true rate, which looks to both sides
REST_S = 0.9
SLOPE_SAMPLES = {"marker": 4, "twist": 6}  # over which a detector takes a slope, the newest last
BEFORE_S, AFTER_S = 0.05, 0.15  # a detection that begins so early or so late still belongs to a slip
TICK_S = 2e-3

Interval = tuple[float, float]


class Score(NamedTuple):
    """How a detector did; delay of the found ones, median [s]."""

    found: int
    missed: int
    false: int
    delays: tuple[float, ...]

    def __add__(self, other: tuple[object, ...]) -> Score:  # type: ignore[override]
        assert isinstance(other, Score)
        return Score(*(a + b for a, b in zip(self, other, strict=True)))  # type: ignore[arg-type]

    def cells(self) -> str:
        """Return cells of a table."""
        delay = f"{1e3 * float(np.median(self.delays)):.0f}" if self.delays else ""
        return f"{self.found} | {self.missed} | {self.false} | {delay}"


def even(run: Run) -> tuple[Array, Array]:
    """Return stamps at an even rate while the marker is seen, and the rotation there; (n,) [s], [deg]."""
    t = run.time[run.seen]
    grid = np.arange(t[0], t[-1], 1.0 / RATE_HZ)
    return grid, np.interp(grid, t, run.rotation[run.seen])


def intervals(t: Array, on: Array, shortest: float = 0.0, merged: float = 0.0) -> list[Interval]:
    """Return from when to when something is on; short gaps are closed first, then short times left out."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], on.astype(int), [0]))))
    found: list[Interval] = []
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        begin, end = float(t[first]), float(t[after - 1])
        if found and begin - found[-1][1] <= merged:
            found[-1] = (found[-1][0], end)
        else:
            found.append((begin, end))
    return [(begin, end) for begin, end in found if end - begin >= shortest]


def true_slips(run: Run) -> list[Interval]:
    """Return when the object truly slips, by the marker."""
    t, rotation = even(run)
    rate = savgol_filter(rotation, WINDOW, DEGREE, deriv=1, delta=1.0 / RATE_HZ)
    return intervals(t, np.abs(rate) > TRUE_DEG_S, SHORTEST_S, MERGED_S)


def slopes(values: Array, samples: int) -> Array:
    """Return the least-squares slope over the last samples, 0 before there are so many; (n,) [unit/s]."""
    weights = np.arange(samples) - (samples - 1) / 2
    weights *= RATE_HZ / (weights**2).sum()
    result = np.zeros(values.size)
    result[samples - 1 :] = np.correlate(values, weights, "valid")
    return result


def score(detected: Sequence[Interval], true: Sequence[Interval]) -> Score:
    """Compare detections with true slips by where detections begin.

    A detection that begins outside of every slip is false, and finds nothing however long it lasts. A slip is found
    where another one begins in it, or goes on into it from a slip before.
    """

    def begins_in(one: Interval, slip: Interval) -> bool:
        return slip[0] - BEFORE_S <= one[0] <= slip[1] + AFTER_S

    right = [one for one in detected if any(begins_in(one, slip) for slip in true)]
    delays = []
    for slip in true:
        own = [one for one in right if one[0] <= slip[1] and one[1] >= slip[0]]
        if own:
            delays.append(max(own[0][0], slip[0]) - slip[0])
    return Score(len(delays), len(true) - len(delays), len(detected) - len(right), tuple(delays))


@kernel(VOID, IN1, OUT1, OUT2, IN1, OUT2, IN1, IN1, IN1, IN1, OUT1)
def _watch(
    config: Array, state: Array, history: Array, motion: Array, sample: Array,
    ticks: Array, arrival: Array, stamp: Array, rate: Array, on: Array,
) -> None:  # fmt: skip
    """Run the observer tick by tick; `on`, written: 1 where it reports slip."""
    settings, estimate, still = record(config, OBSERVER_CONFIG), record(state, OBSERVER), record(motion, MOTION)
    slips = records(sample, SLIP_SAMPLE)
    reset(settings, estimate, round(1e9 * (2.0 * ticks[0] - ticks[1])), still.v_ee)
    following = 0
    for k in range(ticks.size):
        count = 0
        if following < arrival.size and arrival[following] <= ticks[k]:
            slips[0].stamp_ns = round(1e9 * stamp[following])
            slips[0].twist[5] = rate[following]
            following, count = following + 1, 1
        observe(settings, estimate, history, still, round(1e9 * ticks[k]), slips, count)
        on[k] = estimate.sliding


def observed(run: Run, noise_rad_s: float) -> list[Interval]:
    """Return when the slip observer reports slip from marker readings of a known noise.

    A reading is the slope of the last rotations, stamped in their middle. The observer has no wrench, so that its model
    is an object that goes with the pads, which do not turn.
    """
    params = build(
        ControllerParams,
        {
            "contacts.slip_axes": (False, False, False, False, False, True),
            "slip_sensor.rate_hz": RATE_HZ,
            "slip_sensor.noise_angular": noise_rad_s,
            "control_period_s": TICK_S,
        },
        "real run",
    )
    t, rotation = even(run)
    first = SLOPE_SAMPLES["marker"] - 1
    arrival, rate = t[first:], np.deg2rad(slopes(rotation, SLOPE_SAMPLES["marker"]))[first:]
    stamp = arrival - first / (2.0 * RATE_HZ)
    ticks = np.arange(stamp[0], float(t[-1]), TICK_S)
    on, history = np.zeros(ticks.size), np.zeros((capacity(params), ROW_SIZE))
    motion, sample = new(MOTION), new(SLIP_SAMPLE)[np.newaxis]
    record(motion, MOTION).rotation[:] = np.eye(3)
    _watch(observer_config(params), new(OBSERVER), history, motion, sample, ticks, arrival, stamp, rate, on)
    return intervals(ticks, on > 0.0, merged=MERGED_S)


def rest_noise(runs: Sequence[Run]) -> float:
    """Return the largest deviation of marker readings at rest [rad/s]."""
    found = []
    for run in runs:
        t, rotation = even(run)
        found.append(np.deg2rad(slopes(rotation, SLOPE_SAMPLES["marker"]))[t < REST_S].std())
    return float(max(found))


def twist_rate(run: Run) -> Array:
    """Return how fast the shear field's twist changes; on the stamps of `even` [counts/s]."""
    return np.abs(slopes(np.interp(even(run)[0], run.time, run.shear_twist), SLOPE_SAMPLES["twist"]))


def shear_load(run: Run) -> Array:
    """Return the shear along the path; on the stamps of `even` [counts]."""
    return np.abs(np.interp(even(run)[0], run.time, run.shear_ahead))


def over(run: Run, signal: Array, threshold: float) -> list[Interval]:
    """Return when a signal exceeds a threshold."""
    return intervals(even(run)[0], signal > threshold, merged=MERGED_S)


def learnt_threshold(runs: Sequence[Run], signal: Callable[[Run], Array]) -> float:
    """Return the threshold that finds most for the fewest false alarms on some runs; the middle of the best ones."""
    signals = [signal(run) for run in runs]
    steps = np.linspace(0.0, max(s.max() for s in signals), 101)[1:]
    gains = []
    for threshold in steps:
        scores = [score(over(run, s, threshold), true_slips(run)) for run, s in zip(runs, signals, strict=True)]
        gains.append(sum(one.found - one.missed - one.false for one in scores))
    return float(np.median(steps[np.array(gains) == max(gains)]))


def detections(run: Run, others: Sequence[Run]) -> dict[str, list[Interval]]:
    """Return what every detector reports of a run, tuned on other runs alone."""
    return {
        "slip observer, marker": observed(run, rest_noise(others)),
        "twist of the shear field": over(run, twist_rate(run), learnt_threshold(others, twist_rate)),
        "load of the shear field": over(run, shear_load(run), learnt_threshold(others, shear_load)),
    }


def table() -> list[str]:
    """Return the lines of the table, run by run and in total."""
    runs = read_table()
    lines = ["| run | slips | detector | found | missed | false | delay ms |", "|---|---|---|---|---|---|---|"]
    total: dict[str, Score] = {}
    for run in runs:
        true = true_slips(run)
        for name, found in detections(run, [other for other in runs if other is not run]).items():
            one = score(found, true)
            total[name] = total[name] + one if name in total else one
            lines.append(f"| {run.name} | {len(true)} | {name} | {one.cells()} |")
    count = sum(len(true_slips(run)) for run in runs)
    return lines + [f"| all | {count} | {name} | {one.cells()} |" for name, one in total.items()]
