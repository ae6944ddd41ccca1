"""The timing of a path that friction admits: the governor's own planning and steps, without an arm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from slip_core.arrays import Array, inertia_from_six, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_vic.retime.path import GivenPath
from slip_vic_controller.governor.layouts import GOVERNOR_CONFIG
from slip_vic_controller.governor.plan import GRID_POINTS
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.retiming import (
    HELD_OBJECT,
    MEMORY,
    STEP,
    HeldObject,
    plan_timing,
    sample_times,
    step_timing,
    time_derivatives,
)

LONGEST = 30.0
"""Times the duration of the path as given after which the search for a timing is given up."""


@dataclass(frozen=True)
class Timing:
    """When the path is where: at times (m,) [s] its own time (m,) [s], with first and second derivative."""

    times: Array
    path_times: Array
    rates: Array
    rate_rates: Array


def held_object(params: ControllerParams) -> Array:
    """Return the HELD_OBJECT of the parameters: the object on the axes of the pad, as it was grasped."""
    R = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4])
    buffer = new(HELD_OBJECT)
    held: HeldObject = record(buffer, HELD_OBJECT)
    held.mass = params.object.mass
    held.inertia[:] = R.T @ inertia_from_six(params.object.inertia, "parameter object.inertia") @ R
    held.r[:] = R.T @ np.array(params.contacts.position[:3])
    return buffer


def retimed(path: GivenPath, config: Array, held: Array, period_s: float) -> Timing:
    """Return the timing of a path, a row per control period.

    Args:
        path: at rest at both ends.
        config: GOVERNOR_CONFIG.
        held: HELD_OBJECT.
        period_s: control period [s].

    Raises:
        InputError: friction cannot carry the weight somewhere on the path, or the path comes to no end.
    """
    memory = new(MEMORY)
    config = config.copy()
    record(config, GOVERNOR_CONFIG).duration = path.duration
    times = np.empty(GRID_POINTS)
    sample_times(config, times)
    motion = [path.pad(float(at)) for at in times]
    sampled = [np.concatenate((pad.rotation.ravel(), pad.twist, pad.acceleration)) for pad in motion]
    plan_timing(config, memory, held, np.array(sampled))
    state: Any = record(memory, MEMORY).governor
    if state.infeasible:
        _refuse_too_heavy(path, config, state)
    step, rows, at = new(STEP), [(0.0, 0.0, 0.0, 0.0)], 0.0
    out: Any = record(step, STEP)
    most = round(LONGEST * path.duration / period_s)
    while out.arrived == 0.0:
        if len(rows) > most:
            raise InputError(
                "timing", got=f"{100.0 * at / path.duration:.0f} % of the path after {len(rows) * period_s:.0f} s",
                expected="the end of the path", fix="more grip or friction, or a path without noise",
            )  # fmt: skip
        pad = path.pad(float(state.time))
        step_timing(config, memory, held, pad.rotation, pad.twist, pad.acceleration, period_s, step)
        pad = path.pad(float(out.time))
        time_derivatives(config, memory, pad.rotation, pad.twist, pad.acceleration, step)
        at = float(out.time)
        rows.append((len(rows) * period_s, at, float(out.rate), float(out.rate_rate)))
    return Timing(*np.array(rows).T)


def _refuse_too_heavy(path: GivenPath, config: Array, state: Any) -> None:
    heaviest_s, weight = float(state.heaviest_time), float(state.weight_load)
    carries = float(record(config, GOVERNOR_CONFIG).path_margin * state.plan_load)
    x, y, z = path.pad(heaviest_s).position
    raise InputError(
        "path",
        got=f"holding the weight needs {weight:.3g} N at {heaviest_s:.3f} s, x {x:.3f}, y {y:.3f}, z {z:.3f} m",
        expected=f"at most {carries:.3g} N, which friction can carry with its margin",
        fix="more grip, a path on which the weight lies less in the pad's plane, or a smaller governor.margin",
    )
