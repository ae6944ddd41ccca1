"""Points of built-in paths, and the reference that such a point makes."""

from __future__ import annotations

from slip_msgs_py.arrays import Array
from slip_msgs_py.compiled import IN1, IN2, OUT1, REAL, VOID, kernel
from slip_vic_controller.core.rotation_kernel import (
    add,
    exponential,
    jacobian_product,
    jacobian_rate_product,
    matmul,
    nine,
    put,
    put_matrix,
    three,
)


@kernel(VOID(IN2, REAL, OUT1))
def quintic_point(polynomials: Array, u: float, out: Array) -> None:
    """Write the values of polynomials at u [s]; coefficients (18, 6), lowest power first -> (18,).

    Implements: ours: Horner's scheme.
    """
    for i in range(18):
        value = 0.0
        for k in range(5, -1, -1):
            value = value * u + polynomials[i, k]
        out[i] = value


@kernel(VOID(IN1, IN1, IN1, OUT1))
def place_reference(point: Array, position: Array, rotation: Array, out: Array) -> None:
    """Write the packed reference of a point of a path, as `trajectory.reference_at` does.

    Args:
        point: displacement and rotation vector, and their two derivatives; (18,) {w}.
        position, rotation: where the path starts; (3,) [m], (9,) by rows.
        out: (24,).

    Implements: ours: R_d = exp(phi) R_0, omega_d = J_l phi_dot, alpha_d = J_l phi_ddot + Jdot_l phi_dot.
    """
    phi, rate = three(point, 3), three(point, 9)
    put(out, 0, add(three(position, 0), three(point, 0)))
    put_matrix(out, 3, matmul(exponential(phi), nine(rotation, 0)))
    put(out, 12, three(point, 6))
    put(out, 15, jacobian_product(phi, rate))
    put(out, 18, three(point, 12))
    put(out, 21, add(jacobian_product(phi, three(point, 15)), jacobian_rate_product(phi, rate)))
