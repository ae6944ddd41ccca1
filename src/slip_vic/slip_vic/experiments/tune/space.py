"""Which parameters are searched, where, and how good the runs with a set of them are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from slip_core.params import flatten
from slip_vic.experiments.rows import Row
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.law.gains import gain_report

DECADE = 10.0
"""Gammas and noises are searched from their default over this to their default times this."""

K_S_RANGE = 20.0
"""k_s is searched from what the sensor's delay allows over this up to what it allows."""

MARGIN = (0.7, 1.0)
LEVER_M = 0.03
"""Length that makes turning in the grasp comparable with sliding, as gains.characteristic_length."""

GAMMAS = ("gains.gamma_kp", "gains.gamma_ko", "gains.gamma_dp", "gains.gamma_do")
NOISES = (
    "observer.process_noise_linear", "observer.process_noise_angular", "observer.drift_linear",
    "observer.drift_angular",
)  # fmt: skip


class Range(NamedTuple):
    """Where a parameter of the controller is searched; log: evenly in its logarithm."""

    name: str
    low: float
    high: float
    log: bool
    default: float


def search_space(scenario: Scenario, law: str, estimator: str) -> list[Range]:
    """Return what is searched around the parameters of a scenario."""
    params = next(iter(scenario.controllers.values()))  # what is searched is the same for all arms
    values = flatten(params)
    allowed = gain_report(params, refuse=False).used
    space = [Range("gains.k_s", allowed / K_S_RANGE, allowed, True, min(values["gains.k_s"], allowed))]
    around = (*GAMMAS, *(() if estimator == "measured" else NOISES))
    space += [Range(n, values[n] / DECADE, values[n] * DECADE, True, values[n]) for n in around if values[n] > 0.0]
    if law == "governed":
        space.append(Range("governor.margin", *MARGIN, False, values["governor.margin"]))
    return space


def assignments(values: Mapping[str, float]) -> tuple[str, ...]:
    """Return the overrides that set these parameters of the controller."""
    return tuple(f"controller.{name}={value!r}" for name, value in values.items())


@dataclass(frozen=True, slots=True)
class Bounds:
    """What less slip may cost, against the default in the same world (mismatch).

    effort_rate: factor on the worst effort rate of its seeds; later_s: later arrival [s].
    """

    effort_rate: float
    later_s: float


class Score(NamedTuple):
    """How good the runs with one set of parameters are.

    slip: the worst [m], turning counted by `LEVER_M`; effort_rate: the worst, rms [N m/s]; arrival: the latest of those
    that arrive [s]; failed: runs that were not ok; excess: how far beyond the bounds, 0 within.
    """

    slip: float
    effort_rate: float
    arrival: float
    failed: int
    excess: float


def slip_of(row: Row) -> float:
    """Return the slip of a run at its end [m], turning included."""
    return math.hypot(float(row["slip_linear_m"]), LEVER_M * float(row["slip_angular_rad"]))


def score(rows: Sequence[Row], defaults: Sequence[Row], bounds: Bounds) -> Score:
    """Return how good the runs of some cases are; `defaults` are the same cases with the default parameters."""
    good = [row for row in rows if row["outcome"] == "ok"]
    excess = float(len(rows) - len(good))
    for world in dict.fromkeys(row["mismatch"] for row in rows):
        own, default = (
            [row for row in some if row["mismatch"] == world and row["outcome"] == "ok"] for some in (rows, defaults)
        )
        if own and default:
            excess += max(0.0, _effort_rate(own) / _effort_rate(default) / bounds.effort_rate - 1.0)
            excess += _lateness(_arrivals(own), _arrivals(default), bounds.later_s)
    return Score(
        max(map(slip_of, good), default=math.inf),
        _effort_rate(good) if good else math.inf,
        max(filter(math.isfinite, _arrivals(good)), default=math.nan),
        len(rows) - len(good),
        excess,
    )


def _effort_rate(rows: Sequence[Row]) -> float:
    """Return the worst effort rate of some runs [N m/s]."""
    return max(float(row["effort_rate_rms_n_m_s"]) for row in rows)


def _arrivals(rows: Sequence[Row]) -> list[float]:
    """Return when some runs arrive [s]; infinite where one never does."""
    return [math.inf if math.isnan(value := float(row["arrival_s"])) else value for row in rows]


def _lateness(found: Sequence[float], default: Sequence[float], later_s: float) -> float:
    """Return how far the arrivals of a world are beyond what is allowed.

    Seeds of one set differ by more than the bound, and what is late with one comes early with another: so the first is
    compared with the first, the last with the last. Where the default never arrives nothing is asked.
    """
    return sum(
        1.0 if math.isinf(own) else max(0.0, own / (other + later_s) - 1.0)
        for own, other in zip(sorted(found), sorted(default), strict=False)
        if math.isfinite(other)
    )


def cost(found: Score, default: Score) -> float:
    """Return what the search makes small [mm]: the worst slip; beyond the bounds never less than the default's."""
    if found.excess == 0.0:
        return 1e3 * found.slip
    worst = max(found.slip, default.slip) if math.isfinite(found.slip) else default.slip
    return 1e3 * worst * (1.0 + found.excess)
