"""One evaluation of the law in one call: slip displacement, law, torque, limits. Layouts: `packing`."""

from __future__ import annotations

import numpy as np

from slip_msgs_py.arrays import Array
from slip_msgs_py.compiled import IN1, IN2, OUT1, REAL, VOID, kernel
from slip_vic_controller.core import law_kernel as law
from slip_vic_controller.core.arm_kernel import BIAS, JDOT_QD, TWIST
from slip_vic_controller.core.rotation_kernel import (
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
from slip_vic_controller.core.torque_kernel import torque_of

_LARGEST = 1e154
"""Beyond it squares overflow; NaN is not below it either."""


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

    # -- slip displacement
    slips = memory_out[3:].reshape(k, 12)
    for i in range(k):
        first = 3 + 12 * i
        linear, angular = law.where_it_slips(contacts[i], samples, 12 * i + 6)
        s, R_s = law.move_slip(three(memory, first), nine(memory, first + 3), linear, angular, dt)
        put(slips[i], 0, s)
        put_matrix(slips[i], 3, R_s)

    # -- the object, on pad axes
    R_ee = nine(arm, 3)
    v_ee, w_ee = three(arm, TWIST), three(arm, TWIST + 3)
    slip = law.where_it_slips(contacts[0], samples, 6)
    w_o, r, fall, turning = law.object_motion(tuning, contacts, samples, slips, R_ee, w_ee, slip[1])
    carried = add(add(fall, vec_cross(turning, r)), law.centripetal(w_o, r))
    carried, turning = add(carried, three(follow_error, 0)), add(turning, three(follow_error, 3))

    # -- errors, impedance with fading gains, compensation; {w}
    a_d = times(settings[0], three(reference, 18)), times(settings[0], three(reference, 21))
    x_e, v_e = minus(three(arm, 0), three(reference, 0)), minus(v_ee, three(reference, 12))
    e_o, R_e = law.attitude_error(R_ee, nine(reference, 3), three(memory, 0))
    e_rate, Theta = law.attitude_rates(e_o, R_e, w_ee, three(reference, 15), a_d[1])
    Z_p = law.faded(tuning, 0, turn(R_ee, slip[0]), x_e, v_e)
    Z_o = law.turned_impedance(e_o, law.faded(tuning, 3, turn(R_ee, slip[1]), e_o, e_rate))
    gate = law.gate_of(tuning, slip[0], slip[1])
    comp = law.compensation(tuning, contacts[0], gate, slip, (carried, turning), turn_back(R_ee, Theta))
    a_p = add(add(a_d[0], Z_p), turn(R_ee, comp[0]))
    a_o = add(add(add(a_d[1], Z_o), Theta), turn(R_ee, comp[1]))
    h_f, h_m = turn(R_ee, three(samples, 0)), turn(R_ee, three(samples, 3))

    # -- joint torque
    force, h_ee, tau_0 = np.empty(6), np.empty(6), np.empty(n)
    put(force, 0, minus(a_p, three(arm, JDOT_QD)))
    put(force, 3, minus(a_o, three(arm, JDOT_QD + 3)))
    put(h_ee, 0, h_f)
    put(h_ee, 3, h_m)
    for j in range(n):
        tau_0[j] = settings[1] * (posture[j] - q[j]) - settings[2] * qd[j]
    torque = out[25 + n : 25 + 2 * n]
    J, M = arm[BIAS + n : BIAS + 7 * n].reshape(6, n), arm[BIAS + 7 * n :].reshape(n, n)
    solved, damping = torque_of(M, arm[BIAS : BIAS + n], J, force, h_ee, tau_0, settings[3], settings[4], torque)

    # -- limits, and the record
    saturated = 0.0
    finite = True
    for j in range(n):
        limit = settings[5 + j]
        saturated += 1.0 if abs(torque[j]) > limit else 0.0
        out[25 + j] = min(max(torque[j], -limit), limit)
        finite = finite and abs(torque[j]) <= _LARGEST
    for i in range(memory_out.shape[0]):
        if i < 3:
            memory_out[i] = e_o[i]
        finite = finite and abs(memory_out[i]) <= _LARGEST
    out[0] = 1.0 if solved and finite else 0.0
    out[1], out[2], out[3] = damping, (1.0 if law.far_turned(e_o) else 0.0), gate
    out[4], out[5], out[6] = norm(x_e), norm(e_o), norm(slip[0])
    put(out, 7, turn(R_ee, fall))
    put(out, 10, turn(R_ee, carried))
    put(out, 13, a_p)
    put(out, 16, a_o)
    put(out, 19, h_f)
    put(out, 22, h_m)
    out[25 + 2 * n] = saturated


@kernel(VOID(IN1, IN1, IN2, IN1, IN1, IN1, OUT1))
def predict_motion(
    arm: Array, tuning: Array, contacts: Array, samples: Array, memory: Array, slip_twist: Array, out: Array
) -> None:
    """Write what an observer needs of the object: G^T a_o + Phi2 (6), G^T a_o - gravity (6), drag (3), w_o (3); {w}.

    Args:
        arm, tuning, contacts, samples, memory: as of `evaluate`, before the slip of this tick is known.
        slip_twist: v_s that the observer knows; (6,) [m/s, rad/s] {ee}.
        out: (18,).

    Implements: ours: `grasp_terms` for an observer.
    """
    R_ee = nine(arm, 3)
    slips = memory[3:].reshape(contacts.shape[0], 12)
    w, r, fall, turning = law.object_motion(
        tuning, contacts, samples, slips, R_ee, three(arm, TWIST + 3), three(slip_twist, 3)
    )
    follow = turn(R_ee, add(fall, vec_cross(turning, r)))
    turning = turn(R_ee, turning)
    put(out, 0, add(follow, turn(R_ee, law.centripetal(w, r))))
    put(out, 3, turning)
    put(out, 6, minus(follow, three(tuning, 44)))
    put(out, 9, turning)
    put(out, 12, times(-1.0 / tuning[34], turn(R_ee, three(samples, 0))))
    put(out, 15, turn(R_ee, w))
