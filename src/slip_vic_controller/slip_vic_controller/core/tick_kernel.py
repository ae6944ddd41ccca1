"""One evaluation of the law in one call: slip displacement, law, torque, limits. Layouts: `packing`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, INT, OUT1, REAL, VOID, kernel, part
from slip_core.small_kernel import LARGEST
from slip_core.vector_kernel import (
    Three,
    add,
    minus,
    nine,
    norm,
    put,
    put_matrix,
    three,
    times,
    turn,
    turn_back,
    vec_cross,
)
from slip_vic_controller.core import law_kernel as law
from slip_vic_controller.core.arm_kernel import BIAS, JDOT_QD, TWIST
from slip_vic_controller.core.torque_kernel import torque_of


class Law(NamedTuple):
    """Every symbol of the law; pairs are linear and angular.

    On pad axes: slip, object, carried (G^T a_o + Phi2), comp, gated. On {w}: the others; v_e = xdot_ee - xdot_d.
    """

    slip: tuple[Three, Three]
    object: law.ObjectMotion
    carried: tuple[Three, Three]
    x_e: Three
    v_e: Three
    e_o: Three
    e_rate: Three
    Theta: Three
    Z: tuple[Three, Three]
    gate: float
    comp: tuple[Three, Three]
    gated: tuple[Three, Three]
    a_d: tuple[Three, Three]
    a_C: tuple[Three, Three]  # noqa: N815


@part
def law_of(
    arm: Array, tuning: Array, contacts: Array, settings: Array, samples: Array, follow_error: Array, memory: Array,
    slips: Array, reference: Array,
) -> Law:  # fmt: skip
    """Return the law at slip displacements (k, 12) that are known; the other arguments are those of `evaluate`."""
    # -- the object, on pad axes
    R_ee = nine(arm, 3)
    v_ee, w_ee = three(arm, TWIST), three(arm, TWIST + 3)
    slip = law.where_it_slips(contacts[0], samples, 6)
    o = law.object_motion(tuning, contacts, samples, slips, R_ee, w_ee, slip[1])
    carried = add(add(o.linear, vec_cross(o.turning, o.r)), law.centripetal(o.w, o.r))
    followed = add(carried, three(follow_error, 0)), add(o.turning, three(follow_error, 3))

    # -- errors, impedance with fading gains, compensation
    a_d = times(settings[0], three(reference, 18)), times(settings[0], three(reference, 21))
    x_e, v_e = minus(three(arm, 0), three(reference, 0)), minus(v_ee, three(reference, 12))
    e_o, R_e = law.attitude_error(R_ee, nine(reference, 3), three(memory, 0))
    e_rate, Theta = law.attitude_rates(e_o, R_e, w_ee, three(reference, 15), a_d[1])
    Z_p = law.faded(tuning, 0, turn(R_ee, slip[0]), x_e, v_e)
    Z_o = law.turned_impedance(e_o, law.faded(tuning, 3, turn(R_ee, slip[1]), e_o, e_rate))
    gate = law.gate_of(tuning, slip[0], slip[1])
    comp = law.compensation(tuning, contacts[0], slip, followed, turn_back(R_ee, Theta))
    gated = law.gated(tuning, gate, comp)
    a_p = add(add(a_d[0], Z_p), turn(R_ee, gated[0]))
    a_o = add(add(add(a_d[1], Z_o), Theta), turn(R_ee, gated[1]))
    return Law(slip, o, followed, x_e, v_e, e_o, e_rate, Theta, (Z_p, Z_o), gate, comp, gated, a_d, (a_p, a_o))


@part
def effort_of(
    arm: Array, settings: Array, samples: Array, t: Law, q: Array, qd: Array, posture: Array, tau_0: Array,
    h_ee: Array, task: Array, null: Array, torque: Array,
) -> tuple[bool, float]:  # fmt: skip
    """Write posture torque, wrench {w} and the parts of the torque; return as `torque_of`."""
    n, R_ee = q.shape[0], nine(arm, 3)
    force = np.empty(6)
    put(force, 0, minus(t.a_C[0], three(arm, JDOT_QD)))
    put(force, 3, minus(t.a_C[1], three(arm, JDOT_QD + 3)))
    put(h_ee, 0, turn(R_ee, three(samples, 0)))
    put(h_ee, 3, turn(R_ee, three(samples, 3)))
    for j in range(n):
        tau_0[j] = settings[1] * (posture[j] - q[j]) - settings[2] * qd[j]
    J, M = arm[BIAS + n : BIAS + 7 * n].reshape(6, n), arm[BIAS + 7 * n :].reshape(n, n)
    bias = arm[BIAS : BIAS + n]
    return torque_of(M, bias, J, force, h_ee, tau_0, settings[3], settings[4], task, null, torque)


@kernel(VOID(IN1, IN1, IN2, IN1, IN1, IN1, IN1, IN1, IN1, IN1, IN1, REAL, OUT1, OUT1))
def evaluate(
    arm: Array, tuning: Array, contacts: Array, settings: Array, samples: Array, follow_error: Array, memory: Array,
    reference: Array, q: Array, qd: Array, posture: Array, dt: float, memory_out: Array, out: Array,
) -> None:  # fmt: skip
    """Write the outcome of the law to `out`, and what the next tick needs to `memory_out`.

    Args:
        arm: record of the arm.
        tuning: gains and object.
        contacts: contacts on the object.
        settings: what does not change.
        samples: wrench and slip velocity of every contact.
        follow_error: what an observer adds to G^T a_o; (6,) [m/s^2, rad/s^2] {ee}.
        memory: attitude error and slip displacements of the tick before.
        reference: desired motion.
        q, qd: joint state; (n,) [rad], [rad/s].
        posture: of the null space; (n,) [rad].
        dt: since the tick before [s].
        memory_out, out: results.

    Implements: ours: `control_law` and `joint_torque` in one call.
    """
    n, k = q.shape[0], contacts.shape[0]
    slips = memory_out[3:].reshape(k, 12)
    for i in range(k):
        first = 3 + 12 * i
        linear, angular = law.where_it_slips(contacts[i], samples, 12 * i + 6)
        s, R_s = law.move_slip(three(memory, first), nine(memory, first + 3), linear, angular, dt)
        put(slips[i], 0, s)
        put_matrix(slips[i], 3, R_s)

    t = law_of(arm, tuning, contacts, settings, samples, follow_error, memory, slips, reference)
    tau_0, h_ee, task, null = np.empty(n), np.empty(6), np.empty(6), np.empty(6)
    torque = out[25 + n : 25 + 2 * n]
    solved, damping = effort_of(arm, settings, samples, t, q, qd, posture, tau_0, h_ee, task, null, torque)

    # -- limits, and the record
    saturated = 0.0
    finite = True
    for j in range(n):
        limit = settings[5 + j]
        saturated += 1.0 if abs(torque[j]) > limit else 0.0
        out[25 + j] = min(max(torque[j], -limit), limit)
        finite = finite and abs(torque[j]) <= LARGEST
    for i in range(memory_out.shape[0]):
        if i < 3:
            memory_out[i] = t.e_o[i]
        finite = finite and abs(memory_out[i]) <= LARGEST
    out[0] = 1.0 if solved and finite else 0.0
    out[1], out[2], out[3] = damping, (1.0 if law.far_turned(t.e_o) else 0.0), t.gate
    out[4], out[5], out[6] = norm(t.x_e), norm(t.e_o), norm(t.slip[0])
    R_ee = nine(arm, 3)
    put(out, 7, turn(R_ee, t.object.linear))
    put(out, 10, turn(R_ee, t.carried[0]))
    put(out, 13, t.a_C[0])
    put(out, 16, t.a_C[1])
    for i in range(6):
        out[19 + i] = h_ee[i]
    out[25 + 2 * n] = saturated


@kernel(INT(IN1, IN1, IN2, IN1, IN1, IN1, OUT1))
def predict_motion(
    arm: Array, tuning: Array, contacts: Array, samples: Array, memory: Array, slip_twist: Array, out: Array
) -> int:
    """Write what an observer is told: R_ee (9), v_ee, G^T a_o + Phi2, G^T a_o - gravity (6), drag, w_o (3); {w}.

    Returns 1 where every sample is finite, else 0.

    Args:
        arm, tuning, contacts, samples, memory: as of `evaluate`, before the slip of this tick is known.
        slip_twist: v_s that the observer knows, and perhaps more; (6 ...,) [m/s, rad/s] {ee}.
        out: (33,).

    Implements: ours: `grasp_terms` for an observer.
    """
    R_ee = nine(arm, 3)
    slips = memory[3:].reshape(contacts.shape[0], 12)
    o = law.object_motion(tuning, contacts, samples, slips, R_ee, three(arm, TWIST + 3), three(slip_twist, 3))
    for i in range(9):
        out[i] = arm[3 + i]
    for i in range(6):
        out[9 + i] = arm[TWIST + i]
    follow = turn(R_ee, add(o.linear, vec_cross(o.turning, o.r)))
    turning = turn(R_ee, o.turning)
    put(out, 15, add(follow, turn(R_ee, law.centripetal(o.w, o.r))))
    put(out, 18, turning)
    put(out, 21, minus(follow, three(tuning, 44)))
    put(out, 24, turning)
    put(out, 27, times(-1.0 / tuning[34], turn(R_ee, three(samples, 0))))
    put(out, 30, turn(R_ee, o.w))
    finite = True
    for i in range(samples.shape[0]):
        finite = finite and abs(samples[i]) <= LARGEST
    return 1 if finite else 0
