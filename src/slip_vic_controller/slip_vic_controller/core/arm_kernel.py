"""The record of an arm's terms, gathered from what Pinocchio has computed.

Record, n joints: position (3), rotation (9, by rows), twist (6), Jdot qd (6), bias (n), J (6 n, by rows), M (n n).
"""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2_F, OUT1, VOID, kernel
from slip_core.vector_kernel import add, matmul, nine, put, put_matrix, rows, three, turn, vec_cross

TWIST, JDOT_QD, BIAS = 12, 18, 24
"""Where these begin; J begins at BIAS + n, M at BIAS + 7 n."""


@kernel(VOID(IN1, IN1, IN2_F, IN1, IN1, IN1, IN1, IN1, IN2_F, IN1, IN2_F, OUT1))
def gather(
    qd: Array, placement: Array, R_joint: Array, p_joint: Array, v_lin: Array, v_ang: Array, a_lin: Array, a_ang: Array,
    J_world: Array, nle: Array, M: Array, out: Array,
) -> None:  # fmt: skip
    """Write the record to `out`.

    Args:
        qd: joint velocity; (n,) [rad/s].
        placement: of {ee} on the last joint: position (3), rotation (9, by rows), on joint axes.
        R_joint, p_joint: pose of that joint {w}.
        v_lin, v_ang, a_lin, a_ang: its twist, and its spatial acceleration at zero joint acceleration, on its axes.
        J_world: Jacobian of that joint at the world's origin; (6, n) {w}.
        nle: C qd + g; (n,) [N m].
        M: inertia B(q), upper triangle; (n, n) [kg m2].
        out: the record.

    Implements: ours: Jdot qd is the classical acceleration of {ee} at zero joint acceleration.
    """
    n = qd.shape[0]
    R = rows(R_joint)
    lever = three(placement, 0)
    x = add(three(p_joint, 0), turn(R, lever))
    put(out, 0, x)
    put_matrix(out, 3, matmul(R, nine(placement, 3)))
    w, dw = three(v_ang, 0), three(a_ang, 0)
    v = add(three(v_lin, 0), vec_cross(w, lever))
    put(out, TWIST, turn(R, v))
    put(out, TWIST + 3, turn(R, w))
    dv = add(add(three(a_lin, 0), vec_cross(dw, lever)), vec_cross(w, v))
    put(out, JDOT_QD, turn(R, dv))
    put(out, JDOT_QD + 3, turn(R, dw))
    jacobian, inertia = BIAS + n, BIAS + 7 * n
    for j in range(n):
        out[BIAS + j] = nle[j]
        angular = (J_world[3, j], J_world[4, j], J_world[5, j])
        linear = add((J_world[0, j], J_world[1, j], J_world[2, j]), vec_cross(angular, x))
        for i in range(3):
            out[jacobian + i * n + j] = linear[i]
            out[jacobian + (3 + i) * n + j] = angular[i]
        for i in range(j + 1):
            out[inertia + i * n + j] = M[i, j]
            out[inertia + j * n + i] = M[i, j]
