"""Points of built-in paths, and the reference that such a point makes."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import IN1, IN2, OUT1, REAL, VOID, kernel, part
from slip_core.vector_kernel import add, matmul, nine, put, put_matrix, three
from slip_vic_controller.core.rotation_kernel import exponential, jacobian_product, jacobian_rate_product


@part
def place(point: Array, position: Array, rotation: Array, out: Array) -> None:
    """Write the reference of a point of a path."""
    phi, rate = three(point, 3), three(point, 9)
    put(out, 0, add(three(position, 0), three(point, 0)))
    put_matrix(out, 3, matmul(exponential(phi), nine(rotation, 0)))
    put(out, 12, three(point, 6))
    put(out, 15, jacobian_product(phi, rate))
    put(out, 18, three(point, 12))
    put(out, 21, add(jacobian_product(phi, three(point, 15)), jacobian_rate_product(phi, rate)))


@part
def horner(polynomials: Array, u: float, out: Array) -> None:
    """Write the values of polynomials at u; coefficients (18, 6), lowest power first -> (18,)."""
    for i in range(18):
        value = 0.0
        for k in range(5, -1, -1):
            value = value * u + polynomials[i, k]
        out[i] = value


@kernel(VOID(IN2, REAL, OUT1))
def quintic_point(polynomials: Array, u: float, out: Array) -> None:
    """Write a point of a path: displacement and rotation vector and their derivatives at u [s]; (18, 6) -> (18,).

    Implements: ours: Horner's scheme.
    """
    horner(polynomials, u, out)


@kernel(VOID(IN1, IN1, IN2, OUT1))
def place_reference(point: Array, position: Array, rotation: Array, out: Array) -> None:
    """Write the packed reference of a point of a path, as `trajectory.reference_at` does.

    Args:
        point: displacement and rotation vector, and their two derivatives; (18,) {w}.
        position, rotation: where the path starts; (3,) [m], (3, 3).
        out: (24,).

    Implements: ours: R_d = exp(phi) R_0, omega_d = J_l phi_dot, alpha_d = J_l phi_ddot + Jdot_l phi_dot.
    """
    place(point, position, rotation.reshape(9), out)


@kernel(VOID(IN2, REAL, IN1, IN2, OUT1))
def place_quintic(polynomials: Array, u: float, position: Array, rotation: Array, out: Array) -> None:
    """Write the packed reference of a quintic segment at u [s]: both of the above in one call.

    Implements: ours: the usual path, in the time of one call.
    """
    point = np.empty(18)
    horner(polynomials, u, point)
    place(point, position, rotation.reshape(9), out)
