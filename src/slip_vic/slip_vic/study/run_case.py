"""One case in this process: the closed loop without DDS, summed up as it goes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slip_core.errors import SlipVicError
from slip_vic.run.in_process import run_in_process
from slip_vic.run.judge import Outcome, Verdict, judge
from slip_vic.run.track import Track
from slip_vic.scenarios.scenario import NO_TEXTS, Scenario, Texts
from slip_vic.study.cases import Case
from slip_vic.study.table import METRICS, STUDY, CaseResult


def run_case(case: Case, assignments: Sequence[str], texts: Texts = NO_TEXTS) -> CaseResult[Case]:
    """Run one case; whatever goes wrong becomes a result. Files whose contents stand in `texts` are not opened."""
    try:
        return CaseResult(case, *run_scenario(case.load(assignments, texts)))
    except SlipVicError as error:
        return STUDY.failed(case, "refused", str(error))
    except Exception as error:  # a study must survive whatever a case does
        return STUDY.failed(case, "crashed", f"{type(error).__name__}: {error}")


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
