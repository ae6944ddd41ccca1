"""One case in this process: the closed loop without DDS, summed up as it goes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import SlipVicError
from slip_sim_bridge.plant import DivergenceError
from slip_vic.run.arrival import Arrival
from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import NO_TEXTS, Scenario, Texts
from slip_vic.study.cases import Case

LOST_ERROR_M = 1.0
"""Tracking error beyond which the run ends as diverged."""

ENDS = ("lost", "fault")
"""Incidents after which a run has nothing more to show."""

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
    """Outcome: ok, the kind of an incident, diverged, held (the mode machine stopped the law), refused (bad parameters)
    or crashed; and why.

    metrics: by the names of `METRICS`, NaN where there is nothing to measure.
    """

    case: Case
    outcome: str
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


def failed(case: Case, outcome: str, reason: str) -> CaseResult:
    """Return the result of a case that has no numbers."""
    return CaseResult(case, outcome, reason, dict.fromkeys(METRICS, math.nan))


def run_scenario(scenario: Scenario) -> tuple[str, str, dict[str, float]]:
    """Run a scenario and return outcome, reason and metrics, as of `CaseResult`."""
    ticks, squares, excursion, speed, peak = 0, 0.0, 0.0, 0.0, 0.0
    linear = angular = 0.0
    slip = np.zeros(6)
    outcome, reason = "ok", ""
    steps, arrival = _EffortSteps(), Arrival()
    try:
        for tick in run_in_process(scenario):
            now_s = tick.outputs.stamp_ns * 1e-9
            truth, record = tick.outputs.truth, tick.result.record
            steps.add(tick.result.command.effort)
            slip = truth.slip_displacement
            peak = max(peak, math.hypot(*slip[:3].tolist()))
            speed = max(speed, math.hypot(*truth.slip_velocity[:3].tolist()))
            for incident in tick.incidents:
                if outcome in ("ok", "held") or incident.kind in ENDS:
                    outcome, reason = incident.kind, str(incident)
            if outcome in ENDS:
                break
            if not record.ok:
                if ticks and outcome == "ok":
                    outcome, reason = "held", f"{now_s:.3f} s: {tick.result.reason}"
                continue
            ticks += 1
            arrival.add(now_s, tick.result)
            linear, angular = float(record.law.error_linear), float(record.law.error_angular)
            squares += linear * linear
            excursion = max(excursion, angular)
            if not linear < LOST_ERROR_M:
                outcome, reason = "diverged", f"at {now_s:.3f} s"
                break
    except DivergenceError as failure:
        outcome, reason = "diverged", str(failure)
    values = (
        math.hypot(*slip[:3].tolist()),
        math.hypot(*slip[3:].tolist()),
        speed,
        math.sqrt(squares / max(ticks, 1)),
        linear,
        angular,
        excursion,
        steps.rms / scenario.controller.control_period_s,
        math.nan if outcome in ENDS else arrival.since_s,
        peak,
    )
    return outcome, reason, dict(zip(METRICS, values, strict=True))


class _EffortSteps:
    """Root mean square of the norm of the change of all efforts from tick to tick [N m]."""

    def __init__(self) -> None:
        self._last: Array | None = None
        self._squares, self._count = 0.0, 0

    def add(self, effort: Array) -> None:
        """Take the efforts of a tick [N m]; empty ones are no command."""
        if not effort.size:
            return
        if self._last is not None:
            step = effort - self._last
            self._squares, self._count = self._squares + float((step * step).sum()), self._count + 1
        self._last = effort.copy()

    @property
    def rms(self) -> float:
        return math.sqrt(self._squares / max(self._count, 1))
