"""The internal wrench: what contacts press, pull and twist against each other without moving the object.

Of the wrench h_o = sum_j G_j h_j each contact carries a share, the least in the metric of the limit surface,
W = diag(1, 1, 1, rho^2, rho^2, rho^2): a torque counts as the force at the torsional radius rho. What a contact has
beyond its share is internal,

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
from slip_core.vectors import NOTHING, ZERO, Mat, Spatial, Vec, spatial
from slip_vic_controller.law.config import LawConfig
from slip_vic_controller.law.contact import ContactSample, pad_rotation
from slip_vic_controller.law.gains import Gains, LawGains
from slip_vic_controller.law.object import ObjectMotion, arm_of, solve_symmetric


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
    A = Mat(Vec(xx, xy, xz), Vec(xy, yy, yz), Vec(xz, yz, zz))
    x, y, z = Vec(1.0, 0.0, 0.0), Vec(0.0, 1.0, 0.0), Vec(0.0, 0.0, 1.0)
    inverse = Mat(solve_symmetric(A, x), solve_symmetric(A, y), solve_symmetric(A, z))
    own = arm_of(config, gains, slips, o_R_c, 0) - middle
    reach = math.sqrt(longest * longest + square) * config.radius
    return Sharing(n, middle, own, inverse, reach)


@part
def share_of(shared: Sharing, radius: float, h_o: Spatial) -> Spatial:
    """Return the own contact's share of h_o, W G^T (sum_j G_j W G_j^T)^-1 h_o; [N, N m], both on own pad axes.

    Args:
        shared: how the contacts share.
        radius: rho [m].
        h_o: wrench at the object's centre of mass.

    Implements: ours: the least load in the metric of the limit surface.
    """
    y = shared.inverse @ (h_o.angular - shared.middle.cross(h_o.linear))
    return Spatial((1.0 / shared.contacts) * h_o.linear + y.cross(shared.own), (radius * radius) * y)


@part
def internal_wrench(
    config: LawConfig, gains: LawGains, samples: Records[ContactSample], slips: Records[Pose], o: ObjectMotion,
) -> Spatial:  # fmt: skip
    """Return h_int of the own contact [N, N m] {ee}; zero where there is one contact only.

    Args:
        config, gains, samples, slips: as in `object_motion`.
        o: the object, with h_o.

    Implements: ours: h_int = h - W G^T (sum_j G_j W G_j^T)^-1 h_o.
    """
    if config.contacts < 2:
        return NOTHING
    return spatial(samples[0].wrench) - share_of(sharing(config, gains, slips), config.radius, o.h_o)


@part
def give_way(gains: Gains, h_int: Spatial) -> Spatial:
    """Return the acceleration by which the pad gives way to its internal wrench h_int [N, N m] {w}; [m/s^2, rad/s^2].

    Reason: arms whose bases or references differ press on each other through the object; the torque of Eq. (21) cancels
    h_ee, so without this nothing gives way.

    Implements: ours: kappa M_D^-1 h_int.
    """
    return gains.kappa * h_int / spatial(gains.M_D)
