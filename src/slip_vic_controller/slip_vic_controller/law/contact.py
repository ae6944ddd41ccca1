"""The non-rigid grasp: contacts, slip displacement, contact arm r, and products with the grasp matrix G.

A contact i is described on the object by o_x_p and o_R_p (where {p} was when the grasp was made); the pad has
since moved by the slip displacement (s_l, R_s), a POSE on {p} axes. G = [[I, 0], [S(r), I]] is never formed.
"""

from __future__ import annotations

import numpy as np

from slip_core.arrays import matrix_from_quat_xyzw
from slip_core.compiled import part
from slip_core.errors import InputError
from slip_core.records import Mat3, Pose, Record, Records, Vec3, Vec6, Whole, dtype_of
from slip_core.vectors import ZERO, Mat, Spatial, Vec, mat, put, put_mat, spatial, vec
from slip_vic_controller.law.rotation import exponential, left_jacobian
from slip_vic_controller.params.controller_params import ContactParams
from slip_vic_controller.sizes import MAX_CONTACTS


class Contact(Record):
    """One contact on the object.

    The position of contact 0, the own one, is LawGains.contact_position: it moves with the payload.
    """

    position: Vec3  # m {o}; o_x_p
    rotation: Mat3  # o_R_p
    slip_axes: Vec6  # directions on pad axes in which it can slip, 0 or 1 each


class ContactSample(Record):
    """What is known at one contact, on the axes of its pad."""

    wrench: Vec6  # N, N m; h_ee
    slip_twist: Vec6  # m/s, rad/s; v_s


CONTACT_SAMPLE = dtype_of(ContactSample)


class StampedSlip(Record):
    """A slip sample of one contact, with the time at which it was measured."""

    stamp_ns: Whole
    twist: Vec6  # m/s, rad/s {ee}


SLIP_SAMPLE = dtype_of(StampedSlip)


def fill_contacts(params: ContactParams, contacts: Records[Contact]) -> int:
    """Write the configured contacts to an array of CONTACT, the own arm's first; return their number.

    Raises:
        InputError: more contacts than MAX_CONTACTS.
    """
    count = params.count
    if count > MAX_CONTACTS:
        raise InputError("parameter contacts.position", got=f"{count} contacts", expected=f"at most {MAX_CONTACTS}")
    for i in range(count):
        contacts[i].position[:] = params.position[3 * i : 3 * i + 3]
        contacts[i].rotation[:] = matrix_from_quat_xyzw(params.orientation_xyzw[4 * i : 4 * i + 4])
        contacts[i].slip_axes[:] = np.array(params.slip_axes[6 * i : 6 * i + 6], dtype=float)
    return count


@part
def slip_velocity(contact: Contact, sample: ContactSample) -> Spatial:
    """Return v_s of a contact, zero on axes on which it cannot slip; [m/s, rad/s] {c}."""
    return spatial(contact.slip_axes) * spatial(sample.slip_twist)


@part
def integrate_slip(slip: Pose, v_s: Spatial, dt: float, out: Pose) -> None:
    """Move the pad on the object for `dt` [s] at a slip velocity constant on pad axes [m/s, rad/s] {c}.

    Exact for a constant twist (exponential of SE(3)), so spin does not shrink or grow with the step.

    Implements: Eq. (12), (13), integrated: s_l_dot = R_s v_sl, R_s_dot = R_s S(v_sa).
    """
    s_l, R_s = vec(slip.position), mat(slip.rotation)
    shift, turn = dt * v_s.linear, dt * v_s.angular
    put(out.position, s_l + R_s @ left_jacobian(turn, shift))
    put_mat(out.rotation, R_s @ exponential(turn))


@part
def pad_rotation(contact: Contact, slip: Pose) -> Mat:
    """Return o_R_c = o_R_p R_s, {c} to {o}."""
    return mat(contact.rotation) @ mat(slip.rotation)


@part
def contact_arm(o_R_c: Mat, o_x_p: Vec, contact: Contact, slip: Pose) -> Vec:
    """Return r = x_c - x_o on the axes of the pad whose attitude is o_R_c [m] {ee}; contact and slip are of contact c.

    Implements: Eq. (11).
    """
    return o_R_c.T() @ (o_x_p + mat(contact.rotation) @ vec(slip.position))


@part
def G(r: Vec, h: Spatial) -> Spatial:
    """Return G h, a wrench at the contact as one at the object's centre [N, N m]; all on one frame's axes.

    Implements: Eq. (10), (18): one term of h_o = sum G_i h_ee,i.
    """
    return Spatial(h.linear, h.angular + r.cross(h.linear))


@part
def G_T(r: Vec, v_o: Spatial) -> Spatial:
    """Return G^T v_o, a twist or acceleration of the object as seen at the contact; all on one frame's axes.

    Implements: Eq. (14), its rigid part.
    """
    return Spatial(v_o.linear + v_o.angular.cross(r), v_o.angular)


@part
def G_T_inverse(r: Vec, v_c: Spatial) -> Spatial:
    """Return G^-T v_c, a twist at the contact as one of the object; all on one frame's axes.

    Implements: Eq. (14), solved for v_o.
    """
    return Spatial(v_c.linear - v_c.angular.cross(r), v_c.angular)


@part
def Phi2(w_o: Vec, r: Vec) -> Spatial:
    """Return Phi2 = (w_o x (w_o x r), 0) = (w_o (w_o.r) - r (w_o.w_o), 0); [rad/s], [m] -> [m/s^2].

    Implements: Eq. (17), Phi2.
    """
    return Spatial(w_o.dot(r) * w_o - w_o.dot(w_o) * r, ZERO)
