"""The grasped object on the axes of the own pad: slip on it, and rigid-body dynamics about its centre of mass."""

from __future__ import annotations

from typing import NamedTuple

from slip_core.compiled import part
from slip_core.records import Pose, Records
from slip_core.vectors import Mat, Spatial, Vec, mat, spatial, vec
from slip_vic_controller.law.config import LawConfig
from slip_vic_controller.law.contact import (
    ContactSample,
    G,
    contact_arm,
    integrate_slip,
    pad_rotation,
    slip_velocity,
)
from slip_vic_controller.law.gains import LawGains


class ObjectMotion(NamedTuple):
    """What the object does, on the axes of the own pad {ee}.

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

    Where the own pad is on the object comes with the payload.
    """
    o_x_p = vec(gains.contact_position) if i == 0 else vec(config.contact[i].position)
    return contact_arm(o_R_c, o_x_p, config.contact[i], slips[i])


@part
def object_motion(
    config: LawConfig, gains: LawGains, samples: Records[ContactSample], slips: Records[Pose], R_ee: Mat, w_ee: Vec,
    slip_angular: Vec,
) -> ObjectMotion:  # fmt: skip
    """Return what the object does under the wrenches of all contacts.

    Its attitude is not measured, it follows from the own pad: R_ee = R_o o_R_c. Worked out on pad axes, where wrench
    and slip are measured and slip axes are a mask.

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
    angular = -solve_symmetric(J_o, h_o.angular + w_o.cross(J_o @ w_o))
    return ObjectMotion(w_o, r, h_o, Spatial(linear, angular))


@part
def solve_symmetric(A: Mat, b: Vec) -> Vec:
    """Return x with A x = b by cofactors, for a symmetric positive definite A; its upper triangle counts."""
    xx, xy, xz, yy, yz, zz = A.x.x, A.x.y, A.x.z, A.y.y, A.y.z, A.z.z
    cxx, cxy, cxz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    cyy, cyz, czz = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    k = 1.0 / (xx * cxx + xy * cxy + xz * cxz)
    return k * (Mat(Vec(cxx, cxy, cxz), Vec(cxy, cyy, cyz), Vec(cxz, cyz, czz)) @ b)
