"""The timing of a path that friction admits: the governor's own planning and steps, without an arm."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from slip_core.arrays import Array, inertia_from_six, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.records import new, record
from slip_vic.retime.path import GivenPath
from slip_vic_controller.governor.layouts import GOVERNOR_CONFIG, PATH_MARGIN
from slip_vic_controller.governor.plan import GRID_POINTS, sample_time
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.retiming import MEMORY, plan_timing, step_timing, time_derivatives

MOST_SAMPLES = 100_000
"""Control periods that a path may take, 100 s at 1 kHz: each is a sample in memory and a row of the files."""


class Sample(NamedTuple):
    """Where a motion is on its path at a control period: the path's own time [s] with first and second derivative."""

    path: GivenPath
    time: float
    rate: float
    rate_rate: float


def retimed(path: GivenPath, config: Array, params: ControllerParams, most_samples: int) -> list[Sample]:
    """Return the timing of a path, a sample per control period.

    Args:
        path: at rest at both ends.
        config: GOVERNOR_CONFIG, with the duration of the path.
        params: with the object, as it was grasped.
        most_samples: a motion with more is an error.

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
        carries = float(PATH_MARGIN * state.plan_load)
        needs, at_s = float(state.weight_load), float(state.heaviest_time)
        x, y, z = path.pad(at_s).position
        raise InputError(
            "path",
            got=f"holding the weight needs {needs:.3g} N at {at_s:.3f} s, x {x:.3f}, y {y:.3f}, z {z:.3f} m",
            expected=f"at most {carries:.3g} N, which friction can carry with its margin",
            fix="more grip, a path on which the weight lies less in the pad's plane, or a smaller governor.margin",
        )
    rates, samples = np.zeros(2), [Sample(path, 0.0, 0.0, 0.0)]
    while not (state.arrived == 1 and state.out_rate == 0.0):
        if len(samples) > most_samples:
            share = 100.0 * samples[-1].time / path.duration
            raise InputError(
                "timing", got=f"{share:.0f} % of a section after {len(samples) * period_s:.0f} s",
                expected=f"all sections within {MOST_SAMPLES * period_s:g} s",
                fix="grip harder and set governor.friction_limit, smooth the path, or split it by a stop",
            )  # fmt: skip
        pad = path.pad(float(state.time))
        step_timing(config, memory, pad.rotation, pad.twist, pad.acceleration, period_s)
        pad = path.pad(float(state.out_time))
        time_derivatives(config, memory, pad.rotation, pad.twist, pad.acceleration, rates)
        samples.append(Sample(path, float(state.out_time), float(rates[0]), float(rates[1])))
    # It may come to rest within what counts as arrived, short of the end by less than 1e-6 of the path.
    return [*samples[:-1], samples[-1]._replace(time=path.duration)]
