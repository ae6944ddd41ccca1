"""Friction of a pad as an implicit projection on its limit surface: exact stick, and slip by maximum dissipation.

The contact twist v = (vx, vy, wz) is the velocity of one surface over the other at the pad centre, on pad axes;
f = (fx, fy, tau_z) is the friction on the moving surface. With S = diag(1, 1, rho), rho the torsional radius, all
motions share one speed s = |u|, u = S v, and all loads one limit |f_hat| <= F(s), f_hat = S^-1 f. A step changes the
motion by u = u_free + A_hat f_hat with A_hat = S A S.
"""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.vectors import Sym, largest_eigenvalue

ROOT_MARGIN = 0.5  # |dF/ds| lambda_max(A_hat) of a sub-step; the slip speed is a unique root below 1
MOST_SUBSTEPS = 64


@part
def scaled(rho: float, A: Sym) -> Sym:
    """Return S A S."""
    return Sym(A.xx, A.xy, rho * A.xz, A.yy, rho * A.yz, rho * rho * A.zz)


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
