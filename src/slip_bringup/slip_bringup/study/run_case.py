"""One case in this process: the closed loop without DDS, summed up as it goes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from slip_bringup.inprocess import run_in_process
from slip_bringup.study.cases import Case
from slip_core.errors import SlipVicError
from slip_sim_bridge.plant import DivergenceError

LOST_SLIP_M = 0.3
"""Slip beyond which the object is taken for lost and the run ends."""

LOST_ERROR_M = 1.0
"""Tracking error beyond which the run ends as diverged."""

METRICS = (
    "slip_linear_m",
    "slip_angular_rad",
    "slip_speed_peak_m_s",
    "tracking_rms_m",
    "final_error_m",
    "final_error_rad",
    "attitude_excursion_rad",
)


@dataclass(frozen=True, slots=True)
class CaseResult:
    """Outcome: ok, diverged, held (the mode machine stopped the law), refused (bad parameters) or crashed; and why.

    metrics: by the names of `METRICS`, NaN where there is nothing to measure.
    """

    case: Case
    outcome: str
    reason: str
    metrics: dict[str, float]


def run_case(case: Case, assignments: Sequence[str]) -> CaseResult:
    """Run one case; whatever goes wrong becomes a result."""
    try:
        return _run(case, assignments)
    except SlipVicError as error:
        return CaseResult(case, "refused", str(error), dict.fromkeys(METRICS, math.nan))
    except Exception as error:  # a study must survive whatever a case does
        return CaseResult(case, "crashed", f"{type(error).__name__}: {error}", dict.fromkeys(METRICS, math.nan))


def _run(case: Case, assignments: Sequence[str]) -> CaseResult:
    ticks, squares, excursion, speed = 0, 0.0, 0.0, 0.0
    linear = angular = 0.0
    slip = np.zeros(6)
    outcome, reason = "ok", ""
    try:
        for tick in run_in_process(case.load(assignments)):
            truth, record = tick.outputs.truth, tick.result.record
            slip = truth.slip_displacement
            speed = max(speed, math.hypot(*truth.slip_velocity[:3].tolist()))
            if not record.ok:
                if ticks and outcome == "ok":
                    outcome, reason = "held", f"{tick.outputs.stamp_ns * 1e-9:.3f} s: {tick.result.reason}"
                continue
            ticks += 1
            linear, angular = float(record.law.error_linear), float(record.law.error_angular)
            squares += linear * linear
            excursion = max(excursion, angular)
            if not linear < LOST_ERROR_M or not math.hypot(*slip[:3].tolist()) < LOST_SLIP_M:
                outcome, reason = "diverged", f"at {tick.outputs.stamp_ns * 1e-9:.3f} s"
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
    )
    return CaseResult(case, outcome, reason, dict(zip(METRICS, values, strict=True)))
