"""Friction of a pad as an implicit projection on its limit surface: exact stick, and slip by maximum dissipation.

The contact twist v = (vx, vy, wz) is the velocity of one surface over the other at the pad centre, on pad axes;
f = (fx, fy, tau_z) is the friction on the moving surface. With S = diag(1, 1, rho), rho the torsional radius, all
motions share one speed s = |u|, u = S v, and all loads one limit |f_hat| <= F(s), f_hat = S^-1 f. A step changes the
motion by u = u_free + A_hat f_hat with A_hat = S A S.
"""

from __future__ import annotations

import math
from typing import Any

from slip_core.compiled import part
from slip_core.symmetric import Sym, largest_eigenvalue, with_diagonal
from slip_core.vectors import ZERO, Vec

ROOT_TOLERANCE = 1e-13  # of |.| = 1: rounding level of the secular equation
ROOT_ITERATIONS = 80  # bisection alone would need 45
ROOT_MARGIN = 0.5  # |dF/ds| lambda_max(A_hat) of a sub-step; the slip speed is a unique root below 1
MOST_SUBSTEPS = 64


@part
def scaled(rho: float, A: Sym) -> Sym:
    """Return S A S."""
    return Sym(A.xx, A.xy, rho * A.xz, A.yy, rho * A.yz, rho * rho * A.zz)


def projection(limit: Any) -> Any:
    """Return the part `project(law, u_free, A_hat, normal_force) -> (f_hat [N], u [m/s])` of a rigid law.

    Stick where F(0) holds the load. Otherwise maximum dissipation, f_hat = -F(s) u / s: the speed is the root of
    |(s I + F(s) A_hat)^-1 u_free| = 1, bracketed by (0, |u_free|] and found by Newton steps on 1/|.| - 1, which is
    nearly a straight line in s.

    Args:
        limit: the law's part `limit(law, speed, normal_force) -> (F, dF/ds)`.
    """

    @part
    def project(law: Any, u_free: Vec, A_hat: Sym, normal_force: float) -> tuple[Vec, Vec]:
        hold = A_hat.solve(u_free)
        breakaway, _ = limit(law, 0.0, normal_force)
        if hold.dot(hold) <= breakaway * breakaway:
            return -hold, ZERO

        free_speed = u_free.norm()
        low, high = 0.0, free_speed
        force, _ = limit(law, free_speed, normal_force)
        speed = free_speed - force * u_free.dot(A_hat @ u_free) / (free_speed * free_speed)
        if not low < speed <= high:
            speed = 0.5 * high
        w, size = u_free, 1.0
        for _ in range(ROOT_ITERATIONS):
            force, slope = limit(law, speed, normal_force)
            M = with_diagonal(speed, force * A_hat)
            w = M.solve(u_free)
            size = w.norm()
            if abs(size - 1.0) <= ROOT_TOLERANCE:
                break
            if size > 1.0:
                low = speed
            else:
                high = speed
            gain = M.solve(w).dot(w + slope * (A_hat @ w))
            step = (size - 1.0) * size * size / gain if gain > 0.0 else math.inf
            following = speed + step
            if not low < following < high:
                following = 0.5 * (low + high)
            if abs(following - speed) <= ROOT_TOLERANCE * speed:
                break
            speed = following
        direction = (1.0 / size) * w
        return -force * direction, speed * direction

    return project


@part
def substeps_needed(fall: float, A_hat: Sym) -> int:
    """Return into how many sub-steps a step must be split so that the slip speed is the only root.

    fall: steepest fall of the friction limit [N s/m]; A_hat: of the whole step [m/s/N].
    """
    if fall == 0.0:
        return 1
    share = fall * largest_eigenvalue(A_hat) / ROOT_MARGIN
    if not share < MOST_SUBSTEPS:  # NaN is not below either
        return MOST_SUBSTEPS
    return max(1, math.ceil(share))
