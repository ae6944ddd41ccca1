"""The grasped object on the axes of the own pad: its motion under all contacts, and their internal wrench.

The internal wrench acts between the contacts through the object and does not move it.

Each contact carries a share of the wrench h_o = sum_j G_j h_j, the smallest in the metric of the limit surface, W =
diag(1, 1, 1, rho^2, rho^2, rho^2): a torque counts as the force at the torsional radius rho. The rest of a contact's
wrench is internal,

    h_int,i = h_i - W G_i^T (sum_j G_j W G_j^T)^-1 h_o,    sum_i G_i h_int,i = 0

W is the same on all axes, so the pads' attitudes drop out, and with d_j = r_j - r_mean the inverse is that of

    (n rho^2 I + sum_j (d_j.d_j I - d_j d_j^T)) y = tau_o - r_mean x f_o,    share_i = (f_o / n + y x d_i, rho^2 y)

as if of n masses on massless bars: the shares are the least that hold the object.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slip_core.compiled import part
from slip_core.records import Pose, Records
from slip_core.vectors import NOTHING, ZERO, Mat, Spatial, Sym, Vec, mat, spatial, symmetric, vec
from slip_vic_controller.law.config import LawConfig
from slip_vic_controller.law.contact import ContactSample, G, contact_arm, integrate_slip, pad_rotation, slip_velocity
from slip_vic_controller.law.gains import Gains, LawGains


class ObjectMotion(NamedTuple):
    """Motion of the object, on the axes of the own pad {ee}.

    w_o [rad/s]; r = x_c - x_o [m]; h_o = sum G_i h_ee,i [N, N m]; a_o [m/s^2, rad/s^2].
    """

    w_o: Vec
    r: Vec
    h_o: Spatial
    a_o: Spatial


@part
def integrate_slips(
    config: LawConfig, samples: Records[ContactSample], slips: Records[Pose], dt: float, slips_out: Records[Pose],
) -> None:  # fmt: skip
    """Move the slip displacement of every contact for `dt` [s]; `slips` and `slips_out` may be the same."""
    for i in range(config.contacts):
        integrate_slip(slips[i], slip_velocity(config.contact[i], samples[i]), dt, slips_out[i])


@part
def arm_of(config: LawConfig, gains: LawGains, slips: Records[Pose], o_R_c: Mat, i: int) -> Vec:
    """Return r_i = x_c,i - x_o on the axes of the own pad [m]; o_R_c: its attitude on the object.

    The payload has the position of the own pad on the object.
    """
    o_x_p = vec(gains.contact_position) if i == 0 else vec(config.contact[i].position)
    return contact_arm(o_R_c, o_x_p, config.contact[i], slips[i])


@part
def object_motion(
    config: LawConfig, gains: LawGains, samples: Records[ContactSample], slips: Records[Pose], R_ee: Mat, w_ee: Vec,
    slip_angular: Vec,
) -> ObjectMotion:  # fmt: skip
    """Return the object's motion under the wrenches of all contacts.

    Its attitude is not measured, it follows from the own pad: R_ee = R_o o_R_c. Computed on pad axes, where wrench and
    slip are measured and slip axes are a mask.

    Args:
        config: what does not change.
        gains: in effect.
        samples, slips: of each contact.
        R_ee: attitude of the own pad.
        w_ee: its turning [rad/s] {w}.
        slip_angular: v_sa of the own contact [rad/s] {ee}.

    Implements: Eq. (10), (11), (14): a_o = -B_o^-1 (C_o v_o + g_o + h_o).
    """
    o_R_c = pad_rotation(config.contact[0], slips[0])
    r = arm_of(config, gains, slips, o_R_c, 0)
    w_o = R_ee.T() @ w_ee - slip_angular
    h_o = G(r, spatial(samples[0].wrench))
    for i in range(1, config.contacts):  # the other arms' contacts
        h_i = o_R_c.T() @ pad_rotation(config.contact[i], slips[i]) @ spatial(samples[i].wrench)
        h_o = h_o + G(arm_of(config, gains, slips, o_R_c, i), h_i)
    mass, J_o = gains.object.mass, o_R_c.T() @ (mat(gains.object.inertia) @ o_R_c)
    linear = R_ee.T() @ vec(gains.object.gravity) - (1.0 / mass) * h_o.linear
    angular = -symmetric(J_o).solve(h_o.angular + w_o.cross(J_o @ w_o))
    return ObjectMotion(w_o, r, h_o, Spatial(linear, angular))


@part
def mean_arm(config: LawConfig, gains: LawGains, slips: Records[Pose]) -> Vec:
    """Return the mean of all r_j on the axes of the own pad [m]; of one contact its own r."""
    o_R_c, total = pad_rotation(config.contact[0], slips[0]), ZERO
    for j in range(config.contacts):
        total = total + arm_of(config, gains, slips, o_R_c, j)
    return (1.0 / config.contacts) * total


class Sharing(NamedTuple):
    """How the contacts share a wrench, on the axes of the own pad.

    contacts: how many; middle: mean of all r_j [m]; own: d of the own contact [m]; inverse: of the matrix of y [1/m^2];
    reach: sqrt(d^2 + rho^2) rho, the torque that y puts on the contact farthest from the middle [m^2].
    """

    contacts: int
    middle: Vec
    own: Vec
    inverse: Mat
    reach: float


@part
def sharing(config: LawConfig, gains: LawGains, slips: Records[Pose]) -> Sharing:
    """Return how the contacts share a wrench; `slips` of each."""
    o_R_c, n = pad_rotation(config.contact[0], slips[0]), config.contacts
    middle, square, longest = mean_arm(config, gains, slips), config.radius * config.radius, 0.0
    xx, xy, xz, yy, yz, zz = n * square, 0.0, 0.0, n * square, 0.0, n * square
    for j in range(n):
        d = arm_of(config, gains, slips, o_R_c, j) - middle
        dd = d.dot(d)
        xx, yy, zz = xx + (dd - d.x * d.x), yy + (dd - d.y * d.y), zz + (dd - d.z * d.z)
        xy, xz, yz = xy - d.x * d.y, xz - d.x * d.z, yz - d.y * d.z
        longest = max(longest, math.sqrt(dd))
    A = Sym(xx, xy, xz, yy, yz, zz)
    x, y, z = Vec(1.0, 0.0, 0.0), Vec(0.0, 1.0, 0.0), Vec(0.0, 0.0, 1.0)
    inverse = Mat(A.solve(x), A.solve(y), A.solve(z))
    own = arm_of(config, gains, slips, o_R_c, 0) - middle
    reach = math.sqrt(longest * longest + square) * config.radius
    return Sharing(n, middle, own, inverse, reach)


@part
def internal_wrench(
    config: LawConfig, gains: LawGains, samples: Records[ContactSample], slips: Records[Pose], o: ObjectMotion,
) -> Spatial:  # fmt: skip
    """Return h_int of the own contact [N, N m] {ee}; zero where there is one contact only.

    Args:
        config, gains, samples, slips: as in `object_motion`.
        o: the object, with h_o.

    Implements: ours: h_int = h - W G^T (sum_j G_j W G_j^T)^-1 h_o, the least share in the metric of the limit surface.
    """
    if config.contacts < 2:
        return NOTHING
    shared = sharing(config, gains, slips)
    y = shared.inverse @ (o.h_o.angular - shared.middle.cross(o.h_o.linear))
    force = (1.0 / shared.contacts) * o.h_o.linear + y.cross(shared.own)
    return spatial(samples[0].wrench) - Spatial(force, (config.radius * config.radius) * y)


@part
def internal_yielding(gains: Gains, h_int: Spatial) -> Spatial:
    """Return the acceleration by which the pad yields to its internal wrench h_int [N, N m] {w}; [m/s^2, rad/s^2].

    Reason: arms whose bases or references differ press on each other through the object; the torque of Eq. (21) cancels
    h_ee, so without this nothing yields.

    Implements: ours: kappa M_D^-1 h_int.
    """
    return gains.kappa * h_int / spatial(gains.M_D)
