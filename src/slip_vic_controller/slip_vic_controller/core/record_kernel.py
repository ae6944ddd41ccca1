"""The numbers of a tick worth plotting, all of them in one call: what `diagnostics.numbers_of` takes from a record."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, OUT1, VOID, kernel, part
from slip_core.vector_kernel import (
    Matrix,
    Three,
    add,
    dot,
    minus,
    nine,
    put,
    three,
    times,
    turn,
    turn_back,
    vec_cross,
)
from slip_vic_controller.core import law_kernel as law
from slip_vic_controller.core.arm_kernel import BIAS, TWIST
from slip_vic_controller.core.rotation_kernel import inverse_coefficient_of, logarithm
from slip_vic_controller.core.tick_kernel import effort_of, law_of
from slip_vic_controller.core.torque_kernel import smallest_singular_value

ONES, POSES, SIX, ESTIMATE = 8, 18, 17, 14
"""Single numbers, numbers of three poses, 6-vectors after the poses, numbers of an estimate."""


@part
def _put_two(out: Array, i: int, two: tuple[Three, Three]) -> None:
    put(out, i, two[0])
    put(out, i + 3, two[1])


@part
def _put_pose(out: Array, i: int, position: Three, rotation: Matrix) -> None:
    put(out, i, position)
    put(out, i + 3, logarithm(rotation))


@part
def _error_rate(e: Three, w: Three) -> Three:
    """Return J_l(e)^-1 w."""
    n = vec_cross(e, w)
    return add(minus(w, times(0.5, n)), times(inverse_coefficient_of(dot(e, e)), vec_cross(e, n)))


@kernel(VOID(IN1, IN1, IN2, IN1, IN1, IN1, IN1, IN1, IN1, IN1, IN1, IN1, IN1, OUT1))
def describe(
    arm: Array, tuning: Array, contacts: Array, settings: Array, samples: Array, follow_error: Array, before: Array,
    after: Array, reference: Array, q: Array, qd: Array, posture: Array, estimate: Array, out: Array,
) -> None:  # fmt: skip
    """Write every symbol of a tick to `out`, in the order of `diagnostics.numbers_of`.

    Args:
        arm, tuning, contacts, settings, samples, follow_error, reference, q, qd, posture: as of `evaluate`.
        before, after: memory of the tick before and of this one.
        estimate: sliding, significance, deviations (6), error (6) of an observer; NaN where there is none.
        out: result.

    Implements: ours: the record of `TickTerms` by the tick's own parts.
    """
    n = q.shape[0]
    R_ee = nine(arm, 3)
    slips = after[3:].reshape(contacts.shape[0], 12)
    t = law_of(arm, tuning, contacts, settings, samples, follow_error, before, slips, reference)
    task, null, torque = np.empty(6), np.empty(6), np.empty(n)
    tau_0, h_ee = np.empty(n), np.empty(6)
    _, damping = effort_of(arm, settings, samples, t, q, qd, posture, tau_0, h_ee, task, null, torque)

    energy = 0.0
    for j in range(3):
        energy += tuning[24 + j] * t.v_e[j] * t.v_e[j] + tuning[27 + j] * t.e_rate[j] * t.e_rate[j]
        energy += tuning[j] * t.x_e[j] * t.x_e[j] + tuning[3 + j] * t.e_o[j] * t.e_o[j]
    out[0], out[1] = t.gate, 0.5 * energy
    out[2] = 0.5 * (dot(t.slip[0], t.slip[0]) + dot(t.slip[1], t.slip[1]))
    out[3], out[4] = smallest_singular_value(arm[BIAS + n : BIAS + 7 * n].reshape(6, n)), damping
    out[5], out[6], out[7] = tuning[31], estimate[0], estimate[1]

    _put_pose(out, 8, three(arm, 0), R_ee)
    _put_pose(out, 14, three(reference, 0), nine(reference, 3))
    _put_pose(out, 20, three(slips[0], 0), nine(slips[0], 3))
    i = ONES + POSES
    for j in range(6):
        out[i + j], out[i + 6 + j] = arm[TWIST + j], h_ee[j]
    v_s = turn(R_ee, t.slip[0]), turn(R_ee, t.slip[1])
    _put_two(out, i + 12, v_s)
    _put_two(out, i + 18, (t.x_e, t.e_o))
    _put_two(out, i + 24, (t.v_e, t.e_rate))
    for j in range(6):
        v = abs(v_s[0][j] if j < 3 else v_s[1][j - 3])
        out[i + 30 + j] = tuning[j] * math.exp(-tuning[6 + j] * v)
        out[i + 36 + j] = tuning[12 + j] * math.exp(-tuning[18 + j] * v)
    _put_two(out, i + 42, (turn(R_ee, t.comp[0]), turn(R_ee, t.comp[1])))
    felt = turn(R_ee, t.gated[0]), _error_rate(t.e_o, turn(R_ee, t.gated[1]))
    for j in range(3):
        out[i + 48 + j], out[i + 51 + j] = tuning[24 + j] * felt[0][j], tuning[27 + j] * felt[1][j]
    _put_two(out, i + 54, ((0.0, 0.0, 0.0), t.Theta))
    _put_two(out, i + 60, t.Z)
    _put_two(out, i + 66, t.a_d)
    _put_two(out, i + 72, t.a_C)

    o = t.object
    _put_two(out, i + 78, (turn(R_ee, o.force), turn(R_ee, o.torque)))
    at_object = minus(minus(turn_back(R_ee, three(arm, TWIST)), t.slip[0]), vec_cross(o.w, o.r))
    _put_two(out, i + 84, (turn(R_ee, at_object), turn(R_ee, o.w)))
    _put_two(out, i + 90, (turn(R_ee, o.linear), turn(R_ee, o.turning)))
    _put_two(out, i + 96, (turn(R_ee, law.centripetal(o.w, o.r)), (0.0, 0.0, 0.0)))
    i += 6 * SIX
    for j in range(12):
        out[i + j] = estimate[2 + j]
    i += 12
    J = arm[BIAS + n : BIAS + 7 * n].reshape(6, n)
    for j in range(n):
        pulled, freed = 0.0, tau_0[j]
        for k in range(6):
            pulled += J[k, j] * (task[k] - h_ee[k])
            freed -= J[k, j] * null[k]
        out[i + j], out[i + n + j], out[i + 2 * n + j] = pulled, freed, arm[BIAS + j]
