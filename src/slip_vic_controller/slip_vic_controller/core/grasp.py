"""The non-rigid grasp: slip displacement, contact arm r, grasp matrix G and the terms of slip kinematics.

A contact i is described on the object by o_x_p and o_R_p (where {p} was when the grasp was made); the pad has
since moved by the slip displacement (s_l, R_s) on {p} axes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array, skew
from slip_vic_controller.core.rotation import exp_so3, left_jacobian_product


class Contact(NamedTuple):
    """One contact on the object: position o_x_p (3,) [m] {o}; rotation o_R_p (3, 3); slip_axes (6,) 0 or 1 {c}."""

    position: Array
    rotation: Array
    slip_axes: Array


class SlipDisplacement(NamedTuple):
    """Pose of the pad {c} relative to {p}: position s_l (3,) [m] {p}; rotation R_s (3, 3), {c} to {p}."""

    position: Array
    rotation: Array


def integrate_slip(s: SlipDisplacement, v_s: Array, dt: float) -> SlipDisplacement:
    """Move the pad on the object for `dt` [s] at a slip velocity constant on pad axes; v_s (6,) [m/s, rad/s] {c}.

    Exact for a constant twist (exponential of SE(3)), so spin does not shrink or grow with the step.

    Implements: Eq. (12), (13), integrated: s_l_dot = R_s v_sl, R_s_dot = R_s S(v_sa).
    """
    step = dt * v_s
    shift, turn = step[:3], step[3:]
    position = s.position + s.rotation.dot(left_jacobian_product(turn, shift))
    return SlipDisplacement(position, s.rotation.dot(exp_so3(turn)))


def object_rotation(R_ee: Array, contact: Contact, s: SlipDisplacement) -> Array:
    """Return R_o, {o} to {w}, from the pad's attitude and its slip; (3, 3) -> (3, 3).

    Implements: ours: R_ee = R_o o_R_p R_s turned round; the object's attitude is not measured.
    """
    return R_ee.dot(contact.rotation.dot(s.rotation).T)


def pad_rotation(R_o: Array, contact: Contact, s: SlipDisplacement) -> Array:
    """Return the attitude of a contact's pad, {c} to {w}; (3, 3) -> (3, 3).

    Implements: ours: R_c = R_o o_R_p R_s, for the wrench and slip of contacts on other arms.
    """
    return R_o.dot(contact.rotation).dot(s.rotation)


def contact_arm(R_o: Array, contact: Contact, s: SlipDisplacement) -> Array:
    """Return r = x_c - x_o; (3,) [m] {w}.

    Implements: Eq. (11).
    """
    return R_o.dot(contact.position + contact.rotation.dot(s.position))


def grasp_matrix(r: Array) -> Array:
    """Return G = [[I, 0], [S(r), I]]; r (3,) [m] {w} -> (6, 6), o <- c.

    Implements: Eq. (18).
    """
    G = np.eye(6)
    G[3:, :3] = skew(r)
    return G


def grasp_matrix_parts(R_o: Array, contact: Contact, s: SlipDisplacement) -> tuple[Array, Array]:
    """Return the constant part G_C and the slip-dependent part G_s of the grasp matrix; (6, 6), (6, 6) {w}.

    Implements: Eq. (18), G = G_C + G_s.
    """
    G_s = np.zeros((6, 6))
    G_s[3:, :3] = skew(R_o @ contact.rotation @ s.position)
    return grasp_matrix(R_o @ contact.position), G_s


def to_contact(r: Array, motion_o: Array) -> Array:
    """Return G^T times a twist or acceleration of the object; (3,) [m], (6,) {w} at {o} -> (6,) at the contact.

    Implements: Eq. (14), its rigid part.
    """
    x, y, z = r.tolist()
    vx, vy, vz, wx, wy, wz = motion_o.tolist()
    return np.array((vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x, wx, wy, wz))


def to_object(r: Array, motion_c: Array) -> Array:
    """Return G^-T times a twist at the contact; (3,) [m], (6,) {w} at the contact -> (6,) at {o}.

    Implements: Eq. (14), solved for v_o.
    """
    x, y, z = r.tolist()
    vx, vy, vz, wx, wy, wz = motion_c.tolist()
    return np.array((vx - wy * z + wz * y, vy - wz * x + wx * z, vz - wx * y + wy * x, wx, wy, wz))


def wrench_to_object(r: Array, h: Array) -> Array:
    """Return G h; (3,) [m], (6,) [N, N m] {w} at the contact -> (6,) at {o}.

    Implements: Eq. (10), one term of h_o = sum G_i h_ee,i.
    """
    x, y, z = r.tolist()
    fx, fy, fz, mx, my, mz = h.tolist()
    return np.array((fx, fy, fz, mx + y * fz - z * fy, my + z * fx - x * fz, mz + x * fy - y * fx))


def Phi1(w_o: Array) -> Array:
    """Return Phi1' = diag(2 S(w_o), S(w_o)); (3,) [rad/s] {w} -> (6, 6).

    Implements: Eq. (20), Phi1'.
    """
    out = np.zeros((6, 6))
    out[3:, 3:] = skew(w_o)
    out[:3, :3] = 2.0 * out[3:, 3:]
    return out


def Phi2(w_o: Array, r: Array) -> Array:
    """Return Phi2 = (w_o x (w_o x r), 0) = (w_o (w_o.r) - r (w_o.w_o), 0); (3,) [rad/s], (3,) [m] {w} -> (6,).

    Implements: Eq. (17), Phi2.
    """
    x, y, z = r.tolist()
    wx, wy, wz = w_o.tolist()
    along, square = wx * x + wy * y + wz * z, wx * wx + wy * wy + wz * wz
    return np.array((wx * along - x * square, wy * along - y * square, wz * along - z * square, 0.0, 0.0, 0.0))
