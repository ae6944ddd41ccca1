"""Health of the slip sensor: direction and rate of its readings, compared with the slip.

The control cycle, a bring-up and `identify` use the same code; `SensorHealth` has the texts. The tests:

- Friction opposes slip, so the pad slides over the object in the direction d in which it drags it, whatever the
  coefficient. With M = sum v dt d^T over the slip path, a mounting T explains tr(T M) of it; the best counts, if the
  difference is no chance: a sum of independent errors of any symmetric distribution, outliers included, exceeds z times
  the root of the sum of their squares with a probability below exp(-z^2 / 2) (B. Efron, 1969).
- Measured values differ: a value repeated under new stamps was held.
"""

from __future__ import annotations

import math
from typing import Final

from slip_core.compiled import part
from slip_core.records import Mat3, Real, Record, Vec6, Whole, dtype_of
from slip_core.vectors import Spatial, mat, put_spatial, spatial
from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.contact.friction_estimate import GIVES_M
from slip_vic_controller.sizes import NEVER, ROOM

DIFFERS: Final = 0.7
"""Fraction of the slip path by which another mounting must explain its direction better than the configured one: a
mistake makes a difference of 1 or 2, noise of a sample at six standard deviations one of 0.03."""
PLAIN: Final = 1.1
"""How much more a turn by any angle must explain than inverted or swapped axes: friction and slip are aligned only to
some ten degrees."""


class SlipEvidence(Record):
    """Evidence from the slip readings; rotation at the torsional radius."""

    read_ns: Whole  # stamp of the newest reading, NEVER = none
    read: Vec6  # m/s {ee}; it
    way: Mat3  # m {ee}; M
    length: Real  # m; of the way slipped
    squares: Real  # m^2; sum of the squares of its steps
    spun: Real  # m; of turning in the direction in which the pad drags the object
    turned: Real  # m; of all turning
    turned_squares: Real  # m^2
    count: Whole  # readings of slip
    changes: Whole  # and how many of them differ from the one before
    span_s: Real  # time between them
    found: Whole  # SensorHealth
    value: Real  # as its words say
    limit: Real


SLIP_EVIDENCE = dtype_of(SlipEvidence)


@part
def start_health(state: SlipEvidence) -> None:
    """Start without readings."""
    state.read_ns, state.found, state.value, state.limit = NEVER, SensorHealth.OK.value, 0.0, 0.0
    state.read[:], state.way[:], state.length, state.spun, state.turned = 0.0, 0.0, 0.0, 0.0, 0.0
    state.squares = state.turned_squares = 0.0
    state.count, state.changes, state.span_s = 0, 0, 0.0


@part
def add_reading(state: SlipEvidence, stamp_ns: int, v: Spatial, drags: Spatial, slips: bool) -> None:
    """Take in a reading.

    Args:
        state: changed.
        stamp_ns: its stamp.
        v: [m/s] {ee}, on the axes that can slip, turning at the torsional radius.
        drags: wrench of the pad on the object on these axes {ee}; or any vectors in the directions of both.
        slips: whether the object slips.
    """
    change, last_ns = v - spatial(state.read), state.read_ns
    state.read_ns = stamp_ns
    put_spatial(state.read, v)
    if last_ns == NEVER or stamp_ns <= last_ns or not slips or v.dot(v) == 0.0:
        return
    dt, force, torque = 1e-9 * (stamp_ns - last_ns), drags.linear.norm(), drags.angular.norm()
    state.count, state.span_s = state.count + 1, state.span_s + dt
    state.changes += 1 if change.dot(change) != 0.0 else 0
    if force > 0.0:
        d, step = (1.0 / force) * drags.linear, dt * v.linear
        for i in range(3):
            for j in range(3):
                state.way[i, j] += step[i] * d[j]
        state.length += step.norm()
        state.squares += step.dot(step)
    if torque > 0.0:
        turn = dt * v.angular
        state.spun += turn.dot(drags.angular) / torque
        state.turned += turn.norm()
        state.turned_squares += turn.dot(turn)


@part
def judge_health(state: SlipEvidence, differs: float, significant: float, bias: float, quantum: float) -> None:
    """Write the result, a cause before its consequences.

    Args:
        state: changed.
        differs: see DIFFERS; as a share of the path, 1 - cos of an angle.
        significant: z, from which a sum of readings is no chance; 0 where none of them is an outlier.
        bias: largest one of the readings [m/s]: its contribution to the path, back and forth, is no evidence.
        quantum: step of the readings [m/s]: with a step, equal values do not mean that they were held.
    """
    state.found, state.value, state.limit = mounting(state, differs, significant, bias), 0.0, 0.0
    if quantum == 0.0 and state.count >= ROOM and 2 * state.changes < state.count:
        state.found = SensorHealth.HELD.value
        state.value, state.limit = state.changes / state.span_s, state.count / state.span_s
    elif state.found == SensorHealth.TURNED:
        M = mat(state.way)
        state.value = math.degrees(math.atan2(M.y.x - M.x.y, M.x.x + M.y.y))


@part
def mounting(state: SlipEvidence, differs: float, significant: float, bias: float) -> int:
    """Return the mounting that explains most if it is not the configured one, else OK."""
    M = mat(state.way)
    x, y, z = M.x.x, M.y.y, M.z.z
    better = (
        -2.0 * x,
        -2.0 * y,
        -2.0 * z,
        -2.0 * (x + y + z),
        M.x.y + M.y.x - x - y,
        M.y.z + M.z.y - y - z,
        M.z.x + M.x.z - z - x,
    )
    astray = 2.0 * bias * state.span_s
    by_chance = 2.0 * significant * math.sqrt(state.squares)
    found, most = SensorHealth.OK.value, max(differs * max(state.length, GIVES_M), by_chance) + astray
    for i in range(len(better)):
        if better[i] > most:
            found, most = SensorHealth.X_INVERTED.value + i, better[i]
    if math.hypot(x + y, M.x.y - M.y.x) - x - y > PLAIN * most:
        found = SensorHealth.TURNED.value
    by_chance = 2.0 * significant * math.sqrt(state.turned_squares)
    turns = max(differs * max(state.turned, GIVES_M), by_chance) + astray
    if found == SensorHealth.OK and -2.0 * state.spun > turns:
        found = SensorHealth.TURNS_INVERTED.value
    return int(found)
