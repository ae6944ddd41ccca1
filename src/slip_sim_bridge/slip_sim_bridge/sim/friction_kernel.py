"""A rigid law's friction step as parts of kernels: the formulas of `friction` once more; tests hold both equal.

law     mu_s, mu_k [-], Stribeck velocity [m/s], viscous [N s/m], then the bristles' stiffness [N/m] (0: none),
        damping [N s/m] and breakaway_fraction [-], then the torsional radius rho [m]; made by `laws.packed_law`
"""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.sym3_kernel import Sym3, largest_eigenvalue_of, multiply_of, solve_of
from slip_core.vector_kernel import Three, norm

ROOT_TOLERANCE = 1e-13  # of |.| = 1: rounding level of the secular equation
ROOT_ITERATIONS = 80  # bisection alone would need 45

MU_S, MU_K, STRIBECK_VELOCITY, VISCOUS, STIFFNESS, DAMPING, BREAKAWAY, RHO = range(8)


@part
def limit(law: Array, speed: float, normal_force: float) -> tuple[float, float]:
    """Return `Stribeck.limit`."""
    ratio = speed / law[STRIBECK_VELOCITY]
    extra = normal_force * (law[MU_S] - law[MU_K]) * math.exp(-ratio * ratio)
    slope = law[VISCOUS] - 2.0 * extra * ratio / law[STRIBECK_VELOCITY]
    return normal_force * law[MU_K] + extra + law[VISCOUS] * speed, slope


@part
def project(law: Array, u_free: Three, A_hat: Sym3, normal_force: float) -> tuple[Three, Three]:
    """Return the first two of `friction.project`."""
    hold = solve_of(A_hat, u_free)
    breakaway, _ = limit(law, 0.0, normal_force)
    if hold[0] * hold[0] + hold[1] * hold[1] + hold[2] * hold[2] <= breakaway * breakaway:
        return (-hold[0], -hold[1], -hold[2]), (0.0, 0.0, 0.0)

    ux, uy, uz = u_free
    free_speed = norm(u_free)
    pushed = multiply_of(A_hat, u_free)
    low, high = 0.0, free_speed
    force, _ = limit(law, free_speed, normal_force)
    speed = free_speed - force * (ux * pushed[0] + uy * pushed[1] + uz * pushed[2]) / (free_speed * free_speed)
    if not low < speed <= high:
        speed = 0.5 * high
    xx, xy, xz, yy, yz, zz = A_hat
    w, size = u_free, 1.0
    for _ in range(ROOT_ITERATIONS):
        force, slope = limit(law, speed, normal_force)
        M = (speed + force * xx, force * xy, force * xz, speed + force * yy, force * yz, speed + force * zz)
        w = solve_of(M, u_free)
        size = norm(w)
        if abs(size - 1.0) <= ROOT_TOLERANCE:
            break
        if size > 1.0:
            low = speed
        else:
            high = speed
        q, p = solve_of(M, w), multiply_of(A_hat, w)
        gain = q[0] * (w[0] + slope * p[0]) + q[1] * (w[1] + slope * p[1]) + q[2] * (w[2] + slope * p[2])
        step = (size - 1.0) * size * size / gain if gain > 0.0 else math.inf
        following = speed + step
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - speed) <= ROOT_TOLERANCE * speed:
            break
        speed = following
    scale = 1.0 / size
    x, y, z = w[0] * scale, w[1] * scale, w[2] * scale
    return (-force * x, -force * y, -force * z), (speed * x, speed * y, speed * z)


@part
def substeps_needed(law: Array, A_hat: Sym3, normal_force: float, margin: float, most: int) -> int:
    """Return `friction.substeps_needed`; A_hat is that of the whole step."""
    fall = math.sqrt(2.0 / math.e) * (law[MU_S] - law[MU_K]) * max(0.0, normal_force) / law[STRIBECK_VELOCITY]
    fall = max(0.0, fall - law[VISCOUS])
    if fall == 0.0:
        return 1
    share = fall * largest_eigenvalue_of(A_hat) / margin
    if not share < most:  # NaN is not below either
        return most
    return max(1, math.ceil(share))
