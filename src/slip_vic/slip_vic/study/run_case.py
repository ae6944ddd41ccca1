"""One case in this process: the closed loop without DDS, summed up as it goes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from slip_core.errors import SlipVicError
from slip_vic.run.in_process import run_in_process
from slip_vic.run.judge import Outcome, Verdict, judge
from slip_vic.run.track import Track
from slip_vic.scenarios.scenario import NO_TEXTS, Scenario, Texts
from slip_vic.study.cases import Case

METRICS = (
    "slip_linear_m",
    "slip_angular_rad",
    "slip_speed_peak_m_s",
    "tracking_rms_m",
    "final_error_m",
    "final_error_rad",
    "attitude_excursion_rad",
    "effort_rate_rms_n_m_s",
    "arrival_s",
    "slip_linear_peak_m",
)
"""At the end: slip_*, final_error_*; arrival_s: since when the pad stays within 1 mm and 0.5 degrees of the end of its
path; effort_rate_rms_n_m_s: of the norm of the change of all efforts from tick to tick."""


@dataclass(frozen=True, slots=True)
class CaseResult:
    """Outcome of a run, see `slip_vic.run.judge.Outcome`, and why.

    metrics: by the names of `METRICS`, NaN where there is nothing to measure.
    """

    case: Case
    outcome: Outcome
    reason: str
    metrics: dict[str, float]


def run_case(case: Case, assignments: Sequence[str], texts: Texts = NO_TEXTS) -> CaseResult:
    """Run one case; whatever goes wrong becomes a result. Files whose contents stand in `texts` are not opened."""
    try:
        return CaseResult(case, *run_scenario(case.load(assignments, texts)))
    except SlipVicError as error:
        return failed(case, "refused", str(error))
    except Exception as error:  # a study must survive whatever a case does
        return failed(case, "crashed", f"{type(error).__name__}: {error}")


def failed(case: Case, outcome: Outcome, reason: str) -> CaseResult:
    """Return the result of a case that has no numbers."""
    return CaseResult(case, outcome, reason, dict.fromkeys(METRICS, math.nan))


def run_scenario(scenario: Scenario) -> tuple[Outcome, str, dict[str, float]]:
    """Run a scenario and return outcome, reason and metrics, as in `CaseResult`."""
    verdict = judge(run_in_process(scenario), Track(scenario, whole=False))
    return verdict.outcome, verdict.reason, metrics_of(verdict)


def metrics_of(verdict: Verdict) -> dict[str, float]:
    """Return the numbers of a run that a study keeps, those of the worst arm."""
    if not verdict.arms:
        return dict.fromkeys(METRICS, math.nan)
    found = [_metrics(numbers) for numbers in verdict.arms.values()]
    return {name: max(one[name] for one in found) for name in METRICS}


def _metrics(numbers: Mapping[str, Any]) -> dict[str, float]:
    final = np.array(numbers["final_error"])
    return {
        **{name: float(numbers[name]) for name in METRICS if name in numbers},
        "tracking_rms_m": float(np.linalg.norm(numbers["tracking_rms"][:3])),
        "final_error_m": float(np.linalg.norm(final[:3])),
        "final_error_rad": float(np.linalg.norm(final[3:])),
        "effort_rate_rms_n_m_s": float(numbers["effort_rate_rms_nm_s"]),
    }
