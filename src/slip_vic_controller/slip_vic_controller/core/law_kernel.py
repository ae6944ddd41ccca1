"""The law of `grasp_terms`, `log_error` and `control_law` once more, as parts of the tick's kernel.

Read the plain form: it is the documentation, it makes the record of a tick when somebody looks at one, and tests hold
both equal. Here the grasp is worked out on pad axes, where wrench and slip are measured and slip axes are a mask.
Logarithm coordinates only. The layouts of the packed arrays are in `packing`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.sym3_kernel import solve_of
from slip_core.vector_kernel import (
    Matrix,
    Three,
    add,
    dot,
    matmul,
    minus,
    nine,
    norm,
    three,
    times,
    transposed,
    turn,
    turn_back,
    vec_cross,
)
from slip_vic_controller.core.attitude import LOG_BRANCH_LIMIT, LOG_REPORT
from slip_vic_controller.core.rotation_kernel import (
    coefficients_of,
    exponential,
    inverse_coefficient_of,
    jacobian_product,
    logarithm,
)


class ObjectMotion(NamedTuple):
    """The object as the law knows it; on the axes of the own pad.

    w: w_o; r: x_c - x_o; force, torque: h_o; linear, turning: a_o, without gravity's part taken out.
    """

    w: Three
    r: Three
    force: Three
    torque: Three
    linear: Three
    turning: Three


@part
def move_slip(p: Three, R: Matrix, twist_linear: Three, twist_angular: Three, dt: float) -> tuple[Three, Matrix]:
    """Return `grasp.integrate_slip`."""
    shift, angle = times(dt, twist_linear), times(dt, twist_angular)
    return add(p, turn(R, jacobian_product(angle, shift))), matmul(R, exponential(angle))


@part
def where_it_slips(contact: Array, samples: Array, i: int) -> tuple[Three, Three]:
    """Return the slip velocity that begins at samples[i], zero on axes on which the contact cannot slip; {ee}."""
    v, w, a, b = three(samples, i), three(samples, i + 3), three(contact, 12), three(contact, 15)
    return (a[0] * v[0], a[1] * v[1], a[2] * v[2]), (b[0] * w[0], b[1] * w[1], b[2] * w[2])


@part
def arm_of(pad: Matrix, contacts: Array, i: int, slip: Three) -> Three:
    """Return r = x_c - x_o of contact i on the axes of the own pad, from which `pad` leads to {o}."""
    return turn_back(pad, add(three(contacts[i], 0), turn(nine(contacts[i], 3), slip)))


@part
def object_motion(
    tuning: Array, contacts: Array, wrenches: Array, slips: Array, R_ee: Matrix, w_ee: Three, slip_angular: Three
) -> ObjectMotion:
    """Return what the object does, on the axes of the own pad.

    Args:
        tuning: gains and object.
        contacts: contacts on the object (k, 18).
        wrenches: h_ee,i in the axes of each pad, 12 numbers apart.
        slips: slip displacements (k, 12).
        R_ee: attitude of the own pad.
        w_ee: its turning [rad/s] {w}.
        slip_angular: v_sa of the own contact [rad/s] {ee}.

    Implements: ours: `grasp_terms` on pad axes.
    """
    pad = matmul(nine(contacts[0], 3), nine(slips[0], 3))  # {c} to {o}
    inertia = matmul(transposed(pad), matmul(nine(tuning, 35), pad))
    r = arm_of(pad, contacts, 0, three(slips[0], 0))
    w = minus(turn_back(R_ee, w_ee), slip_angular)
    force, torque = three(wrenches, 0), three(wrenches, 3)
    torque = add(torque, vec_cross(r, force))
    for i in range(1, contacts.shape[0]):  # the other arms' contacts
        B = matmul(transposed(pad), matmul(nine(contacts[i], 3), nine(slips[i], 3)))
        f, n = turn(B, three(wrenches, 12 * i)), turn(B, three(wrenches, 12 * i + 3))
        torque = add(torque, add(n, vec_cross(arm_of(pad, contacts, i, three(slips[i], 0)), f)))
        force = add(force, f)
    moment = add(torque, vec_cross(w, turn(inertia, w)))
    xx, xy, xz, _, yy, yz, _, _, zz = inertia
    turning = times(-1.0, solve_of((xx, xy, xz, yy, yz, zz), moment))
    linear = minus(turn_back(R_ee, three(tuning, 44)), times(1.0 / tuning[34], force))
    return ObjectMotion(w, r, force, torque, linear, turning)


@part
def centripetal(w: Three, r: Three) -> Three:
    """Return w x (w x r), the linear part of Phi2."""
    return minus(times(dot(w, r), w), times(dot(w, w), r))


@part
def attitude_error(R_ee: Matrix, R_d: Matrix, previous: Three) -> tuple[Three, Matrix]:
    """Return the orientation error by logarithm, on the branch of the tick before, and R_e; world axes."""
    R_e = matmul(R_ee, transposed(R_d))
    e = logarithm(R_e)
    angle = norm(e)
    if 2.0 * math.pi - angle < LOG_BRANCH_LIMIT and dot(e, previous) < 0.0:
        e = times(1.0 - 2.0 * math.pi / angle, e)
    return e, R_e


@part
def attitude_rates(e: Three, R_e: Matrix, w_ee: Three, w_d: Three, alpha_d: Three) -> tuple[Three, Three]:
    """Return the rate of the error e and Theta; world axes."""
    w_d_turned = turn(R_e, w_d)
    w = minus(w_ee, w_d_turned)
    t = dot(e, e)
    _, b, a_slope, b_slope = coefficients_of(t)
    n = vec_cross(e, w)
    rate = add(minus(w, times(0.5, n)), times(inverse_coefficient_of(t), vec_cross(e, n)))
    along = dot(e, rate)
    n = vec_cross(e, rate)
    curve = add(times(b_slope * along, e), times(b, rate))
    Theta = add(times(a_slope * along, n), vec_cross(curve, n))
    Theta = add(Theta, vec_cross(w, w_d_turned))
    return rate, add(Theta, minus(turn(R_e, alpha_d), alpha_d))


@part
def faded(tuning: Array, i: int, slip: Three, e: Three, rate: Three) -> Three:
    """Return -M_D^-1 (K(v_s) e + D(v_s) edot) of three axes; slip of those axes {w}; i is 0 or 3."""
    return (
        _faded(tuning, i, slip[0], e[0], rate[0]),
        _faded(tuning, i + 1, slip[1], e[1], rate[1]),
        _faded(tuning, i + 2, slip[2], e[2], rate[2]),
    )


@part
def _faded(tuning: Array, i: int, slip: float, e: float, rate: float) -> float:
    v = abs(slip)
    stiffness = tuning[i] * math.exp(-tuning[6 + i] * v)
    damping = tuning[12 + i] * math.exp(-tuning[18 + i] * v)
    return -(stiffness * e + damping * rate) / tuning[24 + i]


@part
def turned_impedance(e: Three, Z: Three) -> Three:
    """Return J_l(e) Z, the angular T_e M_D^-1 (...)."""
    a, b, _, _ = coefficients_of(dot(e, e))
    n = vec_cross(e, Z)
    return add(Z, add(times(a, n), times(b, vec_cross(e, n))))


@part
def gate_of(tuning: Array, linear: Three, angular: Three) -> float:
    """Return the gate in [0, 1] of a slip velocity {ee}."""
    lever = tuning[32]
    return math.tanh(tuning[30] * math.sqrt(dot(linear, linear) + lever * lever * dot(angular, angular)))


@part
def compensation(
    tuning: Array, axes: Array, slip: tuple[Three, Three], carried: tuple[Three, Three], Theta: Three
) -> tuple[Three, Three]:
    """Return the compensation where the contact can slip; all on pad axes; axes: slip axes from 12 on."""
    k_s = tuning[31]
    a, b = minus(carried[0], times(k_s, slip[0])), minus(minus(carried[1], times(k_s, slip[1])), Theta)
    return (
        (axes[12] * a[0], axes[13] * a[1], axes[14] * a[2]),
        (axes[15] * b[0], axes[16] * b[1], axes[17] * b[2]),
    )


@part
def gated(tuning: Array, gate: float, comp: tuple[Three, Three]) -> tuple[Three, Three]:
    """Return gate times the compensation, its angular part shortened to the limit."""
    linear, angular = times(gate, comp[0]), times(gate, comp[1])
    size = norm(angular)
    if size > tuning[33]:
        angular = times(tuning[33] / size, angular)
    return linear, angular


@part
def far_turned(e: Three) -> bool:
    """Return whether the attitude error is so large that it is reported."""
    return norm(e) > LOG_REPORT
