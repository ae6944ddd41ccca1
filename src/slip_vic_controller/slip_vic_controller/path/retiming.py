"""The governor without an arm: the timing of a path that friction admits, computed ahead.

The same plan and step as in the control cycle, for a pad that follows the path exactly, without feedback. The caller
samples the path: attitude, twist and acceleration over its own time.
"""

from __future__ import annotations

import math
from typing import Any

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, OUT1, REAL, VOID, kernel, part
from slip_core.records import layout, record
from slip_core.vectors import NOTHING, ZERO, mat, spatial, vec
from slip_vic_controller.governor import governor
from slip_vic_controller.governor.layouts import GOVERNOR, GOVERNOR_CONFIG, PAD, GovernorConfig
from slip_vic_controller.governor.load import ALONE, Held, size, weight
from slip_vic_controller.governor.plan import GRID_POINT, GRID_POINTS, along
from slip_vic_controller.governor.step import Pad
from slip_vic_controller.path.paths import Reference

MEMORY = layout([
    ("governor", GOVERNOR), ("grid", GRID_POINT, GRID_POINTS), ("pad", PAD),
    ("mass", "f8"), ("inertia", "f8", (3, 3)), ("r", "f8", 3),
])  # fmt: skip
"""The path in its timing, and the object on the axes of the pad that holds it: mass [kg], inertia about its centre of
mass [kg m^2], r, the pad centre as seen from there [m]."""


@part
def held_object(config: GovernorConfig, memory: Any) -> Held:
    """Return the object for the governor; one pad holds it."""
    weights, gravity = spatial(config.weights), vec(config.gravity)
    return Held(memory.mass, mat(memory.inertia), vec(memory.r), weights, gravity, ALONE)


@kernel(VOID, IN1, OUT1, IN2)
def plan_timing(config: Array, memory: Array, motion: Array) -> None:
    """Plan a path, with the object at rest at its start.

    Args:
        config: GOVERNOR_CONFIG.
        memory: MEMORY; changed.
        motion: of the pad at each `sample_time` (GRID_POINTS, 21) {w}: attitude by rows, twist and acceleration over
            the path's own time.
    """
    c, m = record(config, GOVERNOR_CONFIG), record(memory, MEMORY)
    grasped = held_object(c, m)
    start = mat(motion[0, :9].reshape(3, 3))
    at_rest = size(weight(grasped, start))
    governor.start_pad(c, m.pad, at_rest, False, 1.0)
    m.pad.contact.F_lo = m.pad.contact.carried = m.pad.contact.F_median  # a plan uses all of the configured friction
    governor.start_governor(c, m.governor, m.pad)
    for i in range(GRID_POINTS):
        R = mat(motion[i, :9].reshape(3, 3))
        there = Reference(ZERO, R, spatial(motion[i, 9:15]), spatial(motion[i, 15:]))
        governor.sample_point(c, m.governor, m.grid, i, grasped, there)
    governor.plan(c, m.governor, m.grid)


@kernel(VOID, IN1, OUT1, IN2, IN1, IN1, REAL)
def step_timing(
    config: Array, memory: Array, rotation: Array, twist: Array, acceleration: Array, dt: float
) -> None:  # fmt: skip
    """Take a step on the path.

    Args:
        config, memory: as in `plan_timing`.
        rotation, twist, acceleration: of the path at the governor's time, over the path's own time {w}.
        dt: control period [s].
    """
    c, m = record(config, GOVERNOR_CONFIG), record(memory, MEMORY)
    state, R = m.governor, mat(rotation)
    point = along(c, state.duration, state.time, Reference(ZERO, R, spatial(twist), spatial(acceleration)))
    pad = Pad(ZERO, R, state.rate * point.tangent, NOTHING)
    governor.run(c, state, m.grid, held_object(c, m), point, pad, math.inf, dt)


@kernel(VOID, IN1, OUT1, IN2, IN1, IN1, OUT1)
def time_derivatives(
    config: Array, memory: Array, rotation: Array, twist: Array, acceleration: Array, out: Array
) -> None:
    """Write first and second derivative of the path's time, after a step; (2,) [-, 1/s]. Arguments as in that.

    With ds = speed dt of the path: rate = sdot / speed, rate_rate = (sddot - bend rate^2) / speed.
    """
    c, state = record(config, GOVERNOR_CONFIG), record(memory, MEMORY).governor
    there = Reference(ZERO, mat(rotation), spatial(twist), spatial(acceleration))
    at = along(c, state.duration, state.out_time, there)
    out[0] = state.out_rate / at.speed
    out[1] = (state.out_u - at.bend * out[0] * out[0]) / at.speed
