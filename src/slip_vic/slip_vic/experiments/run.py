"""One world under one law, in this process: the only place where an experiment runs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Final

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import SlipVicError
from slip_sim_bridge.params import BridgeParams
from slip_vic.experiments.driven import driven, watched
from slip_vic.experiments.law import find_law
from slip_vic.experiments.world import KEY, World
from slip_vic.run.in_process import Tick
from slip_vic.run.judge import judge
from slip_vic.scenarios.scenario import LAWS, Scenario

OF_SUMMARY: Final = (
    "slip_linear_m", "slip_angular_rad", "slip_linear_peak_m", "slip_speed_peak_m_s", "tracking_rms_m",
    "final_error_m", "final_error_rad", "attitude_excursion_rad", "effort_rate_rms_n_m_s", "arrival_s",
)  # fmt: skip
SQUEEZES: Final = ("squeeze_mean_n", "squeeze_peak_n", "squeeze_least_n")
METRICS: Final = (*OF_SUMMARY, "slip_path_m", "slip_path_rad", "off_goal_m", *SQUEEZES, "fastest_s")
"""Numbers of a run, of several arms the worst. Those of `slip_vic.run.metrics.summarise`; slip_path_*: length of the
way that the pad slides and turns on the object; off_goal_m: how far the pad ends from the end of its path as planned;
squeeze_*: of the gripper; squeeze_least_n: mean of the load over the friction coefficient that the world has;
fastest_s: see `World`."""
LOST: Final = ("lost", "fault", "failed", "crashed")
"""Outcomes after which nothing holds the object, or the law has failed."""
SHORT_M: Final = 0.02
"""A run that keeps the object and ends farther from its goal is short [m]."""
KINDS: Final = ("arrived", "late", "lost", "short", "held", "refused", "impossible")
"""What becomes of a world. late: carried to the goal, but not within its tolerance; held: the law never began;
impossible: no law carries it without slip, and none is run."""
CARRIED: Final = KINDS[:2]
COLUMNS: Final = (*KEY, "outcome", *METRICS, "reason")
Row = dict[str, str]


def row_of(world: World, outcome: str, reason: str, metrics: Mapping[str, float]) -> Row:
    """Return the row of a run.

    Args:
        world: which.
        outcome: as in `slip_vic.run.run.Outcome`; held too where the pad did not leave the start, which of a closed
            path is its goal; impossible.
        reason: of the outcome.
        metrics: by their names; one that is missing is NaN.
    """
    numbers = [repr(float(metrics.get(name, math.nan))) for name in METRICS]
    return dict(zip(COLUMNS, (*world.key, outcome, *numbers, " ".join(reason.split())), strict=True))


def run(world: World) -> Row:
    """Run a world under its law; whatever goes wrong becomes the outcome of its row.

    On a track of the benchmark every law runs through the interface for foreign laws.
    """
    if not math.isfinite(world.fastest_s):
        return row_of(world, "impossible", "friction does not carry the weight all the way", {})
    own = not world.track and world.law.partition("?")[0] in LAWS
    try:
        outcome, reason, metrics = play(*_begun(world, own))
    except SlipVicError as error:
        return row_of(world, "refused", str(error), {})
    except (Exception, SystemExit) as error:  # the rows of other worlds must come whatever one does
        return row_of(world, "crashed" if own else "failed", f"{type(error).__name__}: {error}", {})
    if world.track and metrics.get("arrival_s") == 0.0:  # of a closed path, whose goal is where it starts
        del metrics["arrival_s"]
        outcome, reason = "stays", "the pad does not leave the start"
    return row_of(world, outcome, reason, metrics | {"fastest_s": world.fastest_s or math.nan})


def play(ticks: Iterable[Tick], scenario: Scenario) -> tuple[str, str, dict[str, float]]:
    """Run to the end; return outcome, reason and the numbers that the run has."""
    squeezes: list[tuple[float, float]] = []

    def noted() -> Iterator[Tick]:
        for tick in ticks:
            pairs = zip(tick.outputs.arms, scenario.bridges.values(), strict=True)
            least = [least_squeeze(arm.readings.wrench.wrench, bridge, tick.time_s) for arm, bridge in pairs]
            squeezes.append((max(arm.readings.grip for arm in tick.outputs.arms), max(least)))
            yield tick

    run = judge(noted(), scenario)
    arms = run.data.arms
    if not arms:
        return run.outcome, run.reason, {}
    found = {name: run.worst(name) for name in OF_SUMMARY}
    slips = [arm.channel("slip_velocity") for arm in arms]
    paths = [slip_path(slip.times, slip.rows) for slip in slips]
    found["slip_path_m"], found["slip_path_rad"] = max(path[0] for path in paths), max(path[1] for path in paths)
    squeeze, least = np.array(squeezes).T
    found |= dict(zip(SQUEEZES, map(float, (squeeze.mean(), squeeze.max(), least.mean())), strict=True))
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


def least_squeeze(wrench: Array, bridge: BridgeParams, time_s: float) -> float:
    """Return the squeeze with which friction just carries a load [N]; wrench (6,) [N, N m] {ee}, the true one."""
    of = bridge.friction
    left = of.falls_to if 0.0 < of.falls_at_s <= time_s else 1.0
    load = math.hypot(wrench[0], wrench[1], wrench[5] / of.torsional_radius)
    return load / (left * (of.mu_k if of.model == "coulomb" else of.mu_s))


def slip_path(time: Array, velocity: Array) -> tuple[float, float]:
    """Return the length of the way that slip velocities (N, 6) go [m], [rad]: their trapezoids."""
    linear, angular = (np.linalg.norm(part, axis=1) for part in (velocity[:, :3], velocity[:, 3:]))
    return float(np.trapezoid(linear, time)), float(np.trapezoid(angular, time))


def kind_of(row: Mapping[str, str]) -> str:
    """Return which of `KINDS` a row is; a run that was stopped in between may reach its goal all the same."""
    if row["outcome"] in LOST:
        return "lost"
    if row["outcome"] in ("refused", "impossible"):
        return row["outcome"]
    off_goal = float(row["off_goal_m"])
    if math.isnan(off_goal) or row["outcome"] == "stays":
        return "held"
    if off_goal > SHORT_M:
        return "short"
    return "arrived" if math.isfinite(float(row["arrival_s"])) else "late"
