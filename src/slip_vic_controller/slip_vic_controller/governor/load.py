"""The load of the contact due to an acceleration of the pad, which friction must carry without slip.

With v_s = 0 the object moves with the pad, so its motion follows from the pad's, and the wrench at the contact from
the object's dynamics. The load is that wrench on the axes on which the contact can slip, torque divided by the
torsional radius: friction carries it while |l| <= mu N =: F, the limit surface of a soft finger. It is affine in the
acceleration:

    l(a_c) = drawn(a_c) + turning(w) + weight,   Eq. (10) and (17) with v_s = 0

All loads are on the axes of the pad.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from slip_core.compiled import part
from slip_core.vectors import ZERO, Mat, Spatial, Vec
from slip_vic_controller.law.object import Sharing

ALONE = Sharing(1, ZERO, ZERO, Mat(ZERO, ZERO, ZERO), 0.0)
"""One pad holds the object."""
SPIN_SHARE: Final = 0.1
"""Of several pads: load of turning over load of accelerating at which the bound on the worse pad is exact."""


class Held(NamedTuple):
    """The object as the pad holds it, on pad axes.

    mass [kg]; inertia J (3, 3) [kg m2] about the centre of mass; r = x_c - x_o [m]; weights: S^-1 Sigma, of forces 0 or
    1, of torques 0 or 1 / radius [1/m]; gravity [m/s^2] {w}; shared: how several pads with one normal share a wrench.
    """

    mass: float
    inertia: Mat
    r: Vec
    weights: Spatial
    gravity: Vec
    shared: Sharing


@part
def at_contact(held: Held, force: Vec, torque: Vec) -> Spatial:
    """Return S^-1 Sigma G^-1 h_o: the load of a wrench at the centre of mass.

    Of several pads: an upper bound of the load of each. Force is shared equally, l = f / n, and a torque about the
    pads' normal adds +-t, so |l +- t|^2 <= (1 + e) |l|^2 + (1 + 1 / e) |t|^2 for any e.
    """
    if held.shared.contacts == 1:
        return held.weights * Spatial(force, torque - held.r.cross(force))
    y = held.shared.inverse @ (torque - held.shared.middle.cross(force))
    turns = (math.sqrt(1.0 + 1.0 / SPIN_SHARE) * held.shared.reach) * y
    return held.weights * Spatial((math.sqrt(1.0 + SPIN_SHARE) / held.shared.contacts) * force, turns)


@part
def drawn(held: Held, R: Mat, a: Spatial) -> Spatial:
    """Return the load due to an acceleration of the pad; a [m/s^2, rad/s^2] {w}; R: {ee} to {w}.

    Implements: Eq. (10), (17): -S^-1 Sigma R^T G^-1 B_o G^-T a.
    """
    a_c = R.T() @ a
    force = -held.mass * (a_c.linear - a_c.angular.cross(held.r))
    return at_contact(held, force, -(held.inertia @ a_c.angular))


@part
def turning(held: Held, R: Mat, w: Vec) -> Spatial:
    """Return the load of turning at w [rad/s] {w}: centripetal and gyroscopic.

    Implements: Eq. (10), (17): S^-1 Sigma R^T G^-1 (B_o G^-T Phi2 - C_o v_o).
    """
    w_c = R.T() @ w
    force = held.mass * (w_c.dot(held.r) * w_c - w_c.dot(w_c) * held.r)
    return at_contact(held, force, -w_c.cross(held.inertia @ w_c))


@part
def weight(held: Held, R: Mat) -> Spatial:
    """Return the load of the object's weight.

    Implements: Eq. (10): -S^-1 Sigma R^T G^-1 g_o.
    """
    return at_contact(held, held.mass * (R.T() @ held.gravity), Vec(0.0, 0.0, 0.0))


@part
def load(held: Held, R: Mat, w: Vec, a: Spatial) -> Spatial:
    """Return l(a): the load at a pad that turns at w [rad/s] and accelerates at a [m/s^2, rad/s^2]; all {w}.

    Implements: Eq. (10), (17) with v_s = 0: S^-1 Sigma R^T h_ee, h_ee = -G^-1 (B_o a_o + C_o v_o + g_o).
    """
    return drawn(held, R, a) + turning(held, R, w) + weight(held, R)


@part
def size(load: Spatial) -> float:
    """Return |l| [N]."""
    return math.sqrt(load.dot(load))
