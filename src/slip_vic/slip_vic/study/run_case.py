"""One case in this process: the closed loop without DDS, summed up as it goes."""

from __future__ import annotations

from collections.abc import Sequence

from slip_core.errors import SlipVicError
from slip_vic.run.in_process import run_in_process
from slip_vic.run.judge import Outcome, judge
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
    return verdict.outcome, verdict.reason, {name: verdict.worst(name) for name in METRICS}
