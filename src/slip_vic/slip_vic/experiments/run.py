"""One world under one law, in this process: the only place where an experiment runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import SlipVicError
from slip_vic.experiments.driven import driven, watched
from slip_vic.experiments.law import find_law
from slip_vic.experiments.world import KEY, OWN_LAWS, World
from slip_vic.run.in_process import Tick
from slip_vic.run.judge import judge
from slip_vic.scenarios.scenario import Scenario

OF_SUMMARY: Final = (
    "slip_linear_m", "slip_angular_rad", "slip_linear_peak_m", "slip_speed_peak_m_s", "tracking_rms_m",
    "final_error_m", "final_error_rad", "attitude_excursion_rad", "effort_rate_rms_n_m_s", "arrival_s",
)  # fmt: skip
METRICS: Final = (*OF_SUMMARY, "slip_path_m", "slip_path_rad", "off_goal_m", "squeeze_mean_n", "squeeze_peak_n")
"""Numbers of a run, of several arms the worst. Those of `slip_vic.run.metrics.summarise`; slip_path_*: length of the
way that the pad slides and turns on the object; off_goal_m: how far the pad ends from the end of its path as planned;
squeeze_*: as commanded."""
LOST: Final = ("lost", "fault", "failed", "crashed")
"""Outcomes after which nothing holds the object, or the law has failed."""
SHORT_M: Final = 0.02
"""A run that keeps the object and ends farther from its goal is short [m]."""
KINDS: Final = ("arrived", "late", "lost", "short", "held", "refused")
"""What becomes of a world. late: carried to the goal, but not within its tolerance; held: the law never began."""
CARRIED: Final = KINDS[:2]
COLUMNS: Final = (*KEY, "outcome", *METRICS, "reason")
Row = dict[str, str]


def row_of(world: World, outcome: str, reason: str, metrics: Mapping[str, float]) -> Row:
    """Return the row of a run.

    Args:
        world: which.
        outcome: as in `slip_vic.run.run.Outcome`; stays: the pad did not leave the start, which of a closed path is
            its goal too.
        reason: of the outcome.
        metrics: by their names; one that is missing is NaN.
    """
    numbers = [repr(float(metrics.get(name, math.nan))) for name in METRICS]
    return dict(zip(COLUMNS, (*world.key, outcome, *numbers, " ".join(reason.split())), strict=True))


def run(world: World) -> Row:
    """Run a world under its law; whatever goes wrong becomes the outcome of its row.

    On a track of the benchmark every law runs through the interface for foreign laws.
    """
    own = not world.track and world.law.partition("?")[0] in OWN_LAWS
    try:
        outcome, reason, metrics = play(*_begun(world, own))
    except SlipVicError as error:
        return row_of(world, "refused", str(error), {})
    except (Exception, SystemExit) as error:  # the rows of other worlds must come whatever one does
        return row_of(world, "crashed" if own else "failed", f"{type(error).__name__}: {error}", {})
    if world.track and metrics.get("arrival_s") == 0.0:  # of a closed path, whose goal is where it starts
        del metrics["arrival_s"]
        outcome, reason = "stays", "the pad does not leave the start"
    return row_of(world, outcome, reason, metrics)


def play(ticks: Iterable[Tick], scenario: Scenario) -> tuple[str, str, dict[str, float]]:
    """Run to the end; return outcome, reason and the numbers that the run has."""
    squeezes: list[float] = []

    def noted() -> Iterator[Tick]:
        now = [bridge.grip.force for bridge in scenario.bridges.values()]
        for tick in ticks:
            now = [before if grip is None else grip for before, grip in zip(now, tick.grips, strict=True)]
            squeezes.append(max(now))
            yield tick

    run = judge(noted(), scenario)
    arms = run.data.arms
    if not arms:
        return run.outcome, run.reason, {}
    found = {name: run.worst(name) for name in OF_SUMMARY}
    slips = [arm.channel("slip_velocity") for arm in arms]
    paths = [slip_path(slip.times, slip.rows) for slip in slips]
    found["slip_path_m"], found["slip_path_rad"] = max(path[0] for path in paths), max(path[1] for path in paths)
    found["squeeze_mean_n"], found["squeeze_peak_n"] = float(np.mean(squeezes)), float(max(squeezes))
    if run.outcome in LOST:
        del found["arrival_s"]
    else:
        found["off_goal_m"] = found["final_error_m"]
    return run.outcome, run.reason, found


def _begun(world: World, own: bool) -> tuple[Iterator[Tick], Scenario]:
    """Return the ticks of a world under its law, and what is judged.

    The squeeze of a foreign law is at most what the track says, and that of the scenario at least.
    """
    if own:
        scenario = world.load(world.law)
        return scenario.ticks(), scenario
    found = find_law(world.law)
    scenario = world.load(getattr(found.kind, "configured", "classical"), found.settings)
    grips = [params.grip for params in scenario.controllers.values()]
    most = max(grip.nominal_force for grip in grips)
    if world.track == "free":
        most = max(most, min(grip.cap for grip in grips))
    return driven(scenario, found.kind(), most if world.track else None), watched(scenario)


def slip_path(time: Array, velocity: Array) -> tuple[float, float]:
    """Return the length of the way that slip velocities (N, 6) go [m], [rad]: their trapezoids."""
    linear, angular = (np.linalg.norm(part, axis=1) for part in (velocity[:, :3], velocity[:, 3:]))
    return float(np.trapezoid(linear, time)), float(np.trapezoid(angular, time))


def kind_of(row: Mapping[str, str]) -> str:
    """Return which of `KINDS` a row is; a run that was stopped in between may reach its goal all the same."""
    if row["outcome"] in LOST:
        return "lost"
    if row["outcome"] == "refused":
        return "refused"
    off_goal = float(row["off_goal_m"])
    if math.isnan(off_goal):
        off_goal = float(row["final_error_m"])
    if math.isnan(off_goal):
        return "held"
    if off_goal > SHORT_M or row["outcome"] == "stays":
        return "short"
    return "arrived" if math.isfinite(float(row["arrival_s"])) else "late"
