"""The timing of a path that friction admits: the governor's own planning and steps, without an arm."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from slip_core.arrays import Array, inertia_from_six, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_vic.retime.path import GivenPath
from slip_vic_controller.governor.layouts import GOVERNOR_CONFIG
from slip_vic_controller.governor.plan import GRID_POINTS, sample_time
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.retiming import MEMORY, plan_timing, step_timing, time_derivatives

LONGEST = 30.0
"""Times the duration of the path as given after which the search for a timing is given up."""


class Sample(NamedTuple):
    """Where a motion is on its path at a control period: the path's own time [s] with first and second derivative."""

    path: GivenPath
    time: float
    rate: float
    rate_rate: float


def retimed(path: GivenPath, config: Array, params: ControllerParams) -> list[Sample]:
    """Return the timing of a path, a sample per control period.

    Args:
        path: at rest at both ends.
        config: GOVERNOR_CONFIG, with the duration of the path.
        params: with the object, as it was grasped.

    Raises:
        InputError: friction cannot carry the weight somewhere on the path, or the path comes to no end.
    """
    memory, period_s = new(MEMORY), params.control_period_s
    grasped: Any = record(memory, MEMORY)  # the object on the axes of the pad
    R = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4])
    grasped.mass = params.object.mass
    grasped.inertia[:] = R.T @ inertia_from_six(params.object.inertia, "parameter object.inertia") @ R
    grasped.r[:] = R.T @ np.array(params.contacts.position[:3])
    mode = int(record(config, GOVERNOR_CONFIG).mode)
    motion = [path.pad(sample_time(mode, i, path.duration)) for i in range(GRID_POINTS)]
    sampled = [np.concatenate((pad.rotation.ravel(), pad.twist, pad.acceleration)) for pad in motion]
    plan_timing(config, memory, np.array(sampled))
    state = grasped.governor
    if state.infeasible:
        _refuse_too_heavy(path, config, state)
    rates, samples = np.zeros(2), [Sample(path, 0.0, 0.0, 0.0)]
    most = round(LONGEST * path.duration / period_s)
    while not (state.arrived == 1 and state.out_rate == 0.0):
        if len(samples) > most:
            share = 100.0 * samples[-1].time / path.duration
            raise InputError(
                "timing", got=f"{share:.0f} % of the path after {len(samples) * period_s:.0f} s",
                expected="the end of the path", fix="more grip or friction, or a path without noise",
            )  # fmt: skip
        pad = path.pad(float(state.time))
        step_timing(config, memory, pad.rotation, pad.twist, pad.acceleration, period_s)
        pad = path.pad(float(state.out_time))
        time_derivatives(config, memory, pad.rotation, pad.twist, pad.acceleration, rates)
        samples.append(Sample(path, float(state.out_time), float(rates[0]), float(rates[1])))
    # It may come to rest within what counts as arrived, short of the end by less than 1e-6 of the path.
    return [*samples[:-1], samples[-1]._replace(time=path.duration)]


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
