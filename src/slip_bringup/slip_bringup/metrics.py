"""Numbers that sum up a run; the same definitions for demo, bench and study."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slip_bringup.series import RunSeries

ARRIVED = 1e-3, float(np.radians(0.5))
"""[m], [rad]"""


def summarise(series: RunSeries) -> dict[str, Any]:
    """Return slip, tracking and effort of one run.

    slip_*: norm of the displacement of the pad on the object, at the end and at its peak, and peak sliding
    speed. tracking_rms, final_error: pose error e of the law (x, y, z, rx, ry, rz) [m, rad]. arrival_s: from when on
    the pad stays within 1 mm and 0.5 degrees of the end of its path; NaN where it does not.
    """
    linear = np.linalg.norm(series.slip_displacement[:, :3], axis=1)
    angular = np.linalg.norm(series.slip_displacement[:, 3:], axis=1)
    error = series.law_six("e")
    evaluated = error[np.isfinite(error).all(axis=1)]
    return {
        "slip_linear_m": float(linear[-1]),
        "slip_angular_rad": float(angular[-1]),
        "slip_linear_peak_m": float(linear.max()),
        "slip_angular_peak_rad": float(angular.max()),
        "slip_speed_peak_m_s": float(np.linalg.norm(series.slip_velocity[:, :3], axis=1).max()),
        "tracking_rms": np.sqrt(np.mean(evaluated**2, axis=0)).tolist(),
        "final_error": evaluated[-1].tolist(),
        "arrival_s": arrival_s(series),
        "attitude_excursion_rad": float(np.linalg.norm(evaluated[:, 3:], axis=1).max()),
        "effort_peak_nm": float(np.abs(series.effort).max()),
    }


def arrival_s(series: RunSeries) -> float:
    """Return from when on the pad stays within ARRIVED of the last desired pose [s]; NaN where it does not."""
    away = series.law_six("position") - series.law_six("desired")[-1]
    near = (np.linalg.norm(away[:, :3], axis=1) < ARRIVED[0]) & (np.linalg.norm(away[:, 3:], axis=1) < ARRIVED[1])
    if not near[-1]:
        return math.nan
    first = 0 if near.all() else int(np.flatnonzero(~near)[-1]) + 1
    return float(series.law_time[first])
