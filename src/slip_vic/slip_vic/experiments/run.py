"""One world under one law, in this process: the only place where an experiment runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import SlipVicError
from slip_vic.experiments.world import World
from slip_vic.run.in_process import Tick, run_in_process
from slip_vic.run.judge import Verdict, judge
from slip_vic.run.metrics import off_goal_m
from slip_vic.run.series import RunSeries
from slip_vic.run.track import Track
from slip_vic.scenarios.scenario import Estimator, Law, Scenario

OF_VERDICT: Final = (
    "slip_linear_m", "slip_angular_rad", "slip_linear_peak_m", "slip_speed_peak_m_s", "tracking_rms_m",
    "final_error_m", "final_error_rad", "attitude_excursion_rad", "effort_rate_rms_n_m_s", "arrival_s",
)  # fmt: skip
METRICS: Final = (
    *OF_VERDICT, "slip_path_m", "slip_path_rad", "off_goal_m", "squeeze_mean_n", "squeeze_peak_n",
)  # fmt: skip
"""Numbers of a run, of several arms the worst. Those of `slip_vic.run.metrics.summarise`; slip_path_*: length of the
way that the pad slides and turns on the object; off_goal_m: how far the pad ends from the end of its path as planned;
squeeze_*: as commanded."""
LOST: Final = ("lost", "fault", "failed", "crashed")
"""Outcomes after which nothing holds the object, or the law has failed."""


@dataclass(frozen=True, slots=True)
class OwnLaw:
    """A law of the controller as `load_scenario` configures it; more: further assignments."""

    law: Law
    estimator: Estimator | None = "observer"
    more: tuple[str, ...] = ()


OWN_LAWS: Final[Mapping[str, OwnLaw]] = {
    "classical": OwnLaw("classical", None),
    "vic": OwnLaw("vic"),
    "governed": OwnLaw("governed"),
    "governed_follow": OwnLaw("governed", more=("controller.grip.control=follow", "bridge.grip.control=follow")),
}


class Result(NamedTuple):
    """What became of a world under a law; outcome: as in `slip_vic.run.judge.Outcome`."""

    world: World
    law: str
    outcome: str
    reason: str
    metrics: Mapping[str, float]


def run(world: World, law: str) -> Result:
    """Run a world under a law; whatever goes wrong becomes the outcome of its row."""
    try:
        own = OWN_LAWS[law]
        scenario = world.load(own.law, own.estimator, own.more)
        track, grips = Track(scenario, whole=False), list[float]()
        verdict = judge(_with_grips(scenario, grips), track)
        return Result(world, law, verdict.outcome, verdict.reason, metrics_of(verdict, track, grips))
    except SlipVicError as error:
        return failed(world, law, "refused", str(error))
    except Exception as error:  # the rows of other worlds must come whatever one does
        return failed(world, law, "crashed", f"{type(error).__name__}: {error}")


def failed(world: World, law: str, outcome: str, reason: str) -> Result:
    """Return the result of a run that has no numbers."""
    return Result(world, law, outcome, reason, dict.fromkeys(METRICS, math.nan))


def _with_grips(scenario: Scenario, grips: list[float]) -> Iterator[Tick]:
    """Yield the ticks of a run, and note the squeeze of each [N], that of the arm with most."""
    nominal = max(params.grip.nominal_force for params in scenario.controllers.values())
    for tick in run_in_process(scenario):
        grips.append(max(nominal if grip is None else grip for grip in tick.grips))
        yield tick


def metrics_of(verdict: Verdict, track: Track, grips: Sequence[float]) -> dict[str, float]:
    """Return the numbers of a run; NaN where it has none."""
    found = dict.fromkeys(METRICS, math.nan) | {name: verdict.worst(name) for name in OF_VERDICT}
    if not track.ticks:
        return found
    series = track.series()
    paths = [slip_path(one) for one in series]
    found["slip_path_m"], found["slip_path_rad"] = max(path[0] for path in paths), max(path[1] for path in paths)
    found["squeeze_mean_n"], found["squeeze_peak_n"] = float(np.mean(grips)), float(max(grips))
    if verdict.outcome not in LOST:
        pairs = zip(series, track.scenario.controllers.values(), strict=True)
        found["off_goal_m"] = max(off_goal_m(one, params) for one, params in pairs)
    return found


def slip_path(series: RunSeries) -> tuple[float, float]:
    """Return the length of the way of a run's slip velocities [m], [rad]: their trapezoids."""
    linear, angular = (np.linalg.norm(part, axis=1) for part in np.hsplit(series.slip_velocity, [3]))
    return _trapezoids(linear, series.time), _trapezoids(angular, series.time)


def _trapezoids(speed: Array, time: Array) -> float:
    return float(np.trapezoid(speed, time))
