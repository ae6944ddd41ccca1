"""The law of `grasp_terms`, `log_error` and `control_law` once more, in plain floats, for every tick.

Arrays of three and six numbers cost more to hand to numpy than to compute with. Read the plain form: it is the
documentation, it makes the record of a tick when somebody looks at one, and tests hold both equal. Here the grasp is
worked out on pad axes, where wrench and slip are measured and slip axes are a mask. Logarithm coordinates only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slip_msgs_py.arrays import Array
from slip_msgs_py.types import CartesianReference
from slip_vic_controller.core.arm import ArmTerms
from slip_vic_controller.core.attitude import LOG_BRANCH_LIMIT, LOG_REPORT
from slip_vic_controller.core.grasp import Contact, SlipDisplacement
from slip_vic_controller.core.impedance import Gains
from slip_vic_controller.core.object_dynamics import ObjectModel
from slip_vic_controller.core.rotation import coefficients, inverse_coefficient, log_so3

Numbers = tuple[float, ...]


class FastTerms(NamedTuple):
    """What a tick needs of the law.

    a_C, h_ee (6,) {w}; attitude_error (3,) [rad] {w}; near_singular: of the attitude; gate in [0, 1]. For the
    supervision: error_linear [m], error_angular [rad], slip_speed [m/s], and on {w}, linear part only, the object's
    acceleration and G^T a_o + Phi2 (3,) [m/s^2].
    """

    a_C: Array  # noqa: N815
    h_ee: Array
    attitude_error: Array
    near_singular: bool
    gate: float
    error_linear: float
    error_angular: float
    slip_speed: float
    object_acceleration: Array
    carried: Array


class FlatTuning(NamedTuple):
    """Gains and object in the form in which the fast law takes them; made once and used until they change."""

    per_axis: tuple[Numbers, ...]
    alpha: float
    k_s: float
    spin_lever: float
    spin_limit: float
    mass: float
    inertia: Array
    gravity: Numbers


def flatten(gains: Gains, model: ObjectModel) -> FlatTuning:
    """Return gains and object with their vectors as plain floats, in the units and frames of their own records.

    Implements: ours: conversion once instead of in every tick.
    """
    diagonals = (gains.K_D, gains.gamma_k, gains.D_D, gains.gamma_d, gains.M_D)
    return FlatTuning(
        tuple(zip(*(diagonal.tolist() for diagonal in diagonals), strict=True)),
        gains.alpha,
        gains.k_s,
        gains.spin_lever,
        gains.spin_limit,
        model.mass,
        model.inertia,
        tuple(model.gravity.tolist()),
    )


def fast_law(
    tuning: FlatTuning,
    contacts: Sequence[Contact],
    slips: Sequence[SlipDisplacement],
    wrenches: Sequence[Array],
    slip_twist: Array,
    follow_error: Array | None,
    arm: ArmTerms,
    reference: CartesianReference,
    feed_forward: bool,
    previous: Array,
) -> FastTerms:
    """Return a_C and what else a tick needs.

    Args:
        tuning: gains and object.
        contacts: all contacts on the object; the own one is number 0.
        slips: their slip displacements.
        wrenches: h_ee,i in the axes of each pad; (6,) [N, N m] each.
        slip_twist: v_s of the own contact; (6,) [m/s, rad/s] {ee}.
        follow_error: what an observer adds to G^T a_o; (6,) [m/s^2, rad/s^2] {ee}, or None.
        arm: kinematics of the own arm.
        reference: desired motion.
        feed_forward: whether to use the desired acceleration.
        previous: orientation error one tick earlier; (3,) [rad] {w}.

    Implements: ours: the equations of `grasp_terms`, `log_error` and `control_law`, without their arrays.
    """
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = arm.rotation.tolist()  # R_ee
    vx, vy, vz, wx, wy, wz = arm.twist.tolist()
    sx, sy, sz, tx, ty, tz = slip_twist.tolist()

    # -- the object, on pad axes: where it is, its twist at the contact, its inertia
    B = contacts[0].rotation.dot(slips[0].rotation)  # {c} to {o}
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = B.T.dot(tuning.inertia).dot(B).tolist()
    pad = B.tolist()
    rx, ry, rz = _arm(pad, contacts[0], slips[0])
    ox = r00 * wx + r10 * wy + r20 * wz - tx
    oy = r01 * wx + r11 * wy + r21 * wz - ty
    oz = r02 * wx + r12 * wy + r22 * wz - tz

    # -- wrench of the object on all pads, at its centre of mass
    fx, fy, fz, nx, ny, nz = wrenches[0].tolist()
    hx, hy, hz = (
        r00 * fx + r01 * fy + r02 * fz,
        r10 * fx + r11 * fy + r12 * fz,
        r20 * fx + r21 * fy + r22 * fz,
    )
    kx, ky, kz = (
        r00 * nx + r01 * ny + r02 * nz,
        r10 * nx + r11 * ny + r12 * nz,
        r20 * nx + r21 * ny + r22 * nz,
    )
    nx, ny, nz = nx + ry * fz - rz * fy, ny + rz * fx - rx * fz, nz + rx * fy - ry * fx
    for contact, slip, wrench in zip(contacts[1:], slips[1:], wrenches[1:], strict=True):
        ax, ay, az, bx, by, bz = _other_wrench(pad, contact, slip, wrench)
        fx, fy, fz, nx, ny, nz = fx + ax, fy + ay, fz + az, nx + bx, ny + by, nz + bz

    # -- its acceleration, a_o, and G^T a_o + Phi2 at the contact
    lx, ly, lz = xx * ox + xy * oy + xz * oz, xy * ox + yy * oy + yz * oz, xz * ox + yz * oy + zz * oz
    nx, ny, nz = nx + oy * lz - oz * ly, ny + oz * lx - ox * lz, nz + ox * ly - oy * lx
    cxx, cxy, cxz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    cyy, cyz, czz = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    k = -1.0 / (xx * cxx + xy * cxy + xz * cxz)
    dx, dy, dz = (
        k * (cxx * nx + cxy * ny + cxz * nz),
        k * (cxy * nx + cyy * ny + cyz * nz),
        k * (cxz * nx + cyz * ny + czz * nz),
    )
    gx, gy, gz = tuning.gravity
    k = 1.0 / tuning.mass
    ax = r00 * gx + r10 * gy + r20 * gz - k * fx
    ay = r01 * gx + r11 * gy + r21 * gz - k * fy
    az = r02 * gx + r12 * gy + r22 * gz - k * fz
    along, square = ox * rx + oy * ry + oz * rz, ox * ox + oy * oy + oz * oz
    px = ax + dy * rz - dz * ry + ox * along - rx * square
    py = ay + dz * rx - dx * rz + oy * along - ry * square
    pz = az + dx * ry - dy * rx + oz * along - rz * square
    if follow_error is not None:
        ex, ey, ez, bx, by, bz = follow_error.tolist()
        px, py, pz, dx, dy, dz = px + ex, py + ey, pz + ez, dx + bx, dy + by, dz + bz

    # -- orientation error by logarithm, its rate, Theta; world axes
    R_e = arm.rotation.dot(reference.rotation.T)
    (e00, e01, e02), (e10, e11, e12), (e20, e21, e22) = R_e.tolist()
    ux, uy, uz, ix, iy, iz = reference.twist.tolist()
    jx, jy, jz, lx, ly, lz = reference.acceleration.tolist() if feed_forward else _ZEROS
    ex, ey, ez, w = e21 - e12, e02 - e20, e10 - e01, 1.0 + e00 + e11 + e22
    if w <= 1.0:
        ex, ey, ez = log_so3(R_e).tolist()
    else:
        norm = math.sqrt(ex * ex + ey * ey + ez * ez)
        k = 2.0 * math.atan2(norm, w) / norm if norm > 1e-12 else 2.0 / w
        ex, ey, ez = k * ex, k * ey, k * ez
    angle = math.sqrt(ex * ex + ey * ey + ez * ez)
    bx, by, bz = previous.tolist()
    if 2.0 * math.pi - angle < LOG_BRANCH_LIMIT and ex * bx + ey * by + ez * bz < 0.0:
        k = 1.0 - 2.0 * math.pi / angle
        ex, ey, ez, angle = k * ex, k * ey, k * ez, 2.0 * math.pi - angle
    fx, fy, fz = (  # R_e w_d
        e00 * ix + e01 * iy + e02 * iz,
        e10 * ix + e11 * iy + e12 * iz,
        e20 * ix + e21 * iy + e22 * iz,
    )
    wx, wy, wz = wx - fx, wy - fy, wz - fz  # w_e
    t = angle * angle
    a, b, a_slope, b_slope = coefficients(t)
    c = inverse_coefficient(t)
    nx, ny, nz = ey * wz - ez * wy, ez * wx - ex * wz, ex * wy - ey * wx  # e x w_e
    ix = wx - 0.5 * nx + c * (ey * nz - ez * ny)
    iy = wy - 0.5 * ny + c * (ez * nx - ex * nz)
    iz = wz - 0.5 * nz + c * (ex * ny - ey * nx)
    k = ex * ix + ey * iy + ez * iz
    a_slope, b_slope = a_slope * k, b_slope * k
    nx, ny, nz = ey * iz - ez * iy, ez * ix - ex * iz, ex * iy - ey * ix  # e x edot
    bx, by, bz = b_slope * ex + b * ix, b_slope * ey + b * iy, b_slope * ez + b * iz
    hxx = a_slope * nx + by * nz - bz * ny + wy * fz - wz * fy + e00 * lx + e01 * ly + e02 * lz - lx  # Theta
    hyy = a_slope * ny + bz * nx - bx * nz + wz * fx - wx * fz + e10 * lx + e11 * ly + e12 * lz - ly
    hzz = a_slope * nz + bx * ny - by * nx + wx * fy - wy * fx + e20 * lx + e21 * ly + e22 * lz - lz

    # -- impedance with fading gains: Z = T_e M_D^-1 (-K e - D edot)
    x, y, z = arm.position.tolist()
    xd, yd, zd = reference.position.tolist()
    x, y, z = x - xd, y - yd, z - zd
    fade = (
        r00 * sx + r01 * sy + r02 * sz, r10 * sx + r11 * sy + r12 * sz, r20 * sx + r21 * sy + r22 * sz,
        r00 * tx + r01 * ty + r02 * tz, r10 * tx + r11 * ty + r12 * tz, r20 * tx + r21 * ty + r22 * tz,
    )  # fmt: skip
    errors, rates = (x, y, z, ex, ey, ez), (vx - ux, vy - uy, vz - uz, ix, iy, iz)
    exp = math.exp
    zx, zy, zz, bx, by, bz = [
        -(K * exp(-gamma_k * abs(v)) * e + D * exp(-gamma_d * abs(v)) * e_dot) / M
        for (K, gamma_k, D, gamma_d, M), v, e, e_dot in zip(tuning.per_axis, fade, errors, rates, strict=True)
    ]
    nx, ny, nz = ey * bz - ez * by, ez * bx - ex * bz, ex * by - ey * bx
    ox = bx + a * nx + b * (ey * nz - ez * ny)
    oy = by + a * ny + b * (ez * nx - ex * nz)
    oz = bz + a * nz + b * (ex * ny - ey * nx)

    # -- gated compensation on pad axes, where the contact can slip, and back to the world
    linear, turning = sx * sx + sy * sy + sz * sz, tx * tx + ty * ty + tz * tz
    gate = math.tanh(tuning.alpha * math.sqrt(linear + tuning.spin_lever**2 * turning))
    k_s = tuning.k_s
    m0, m1, m2, m3, m4, m5 = contacts[0].slip_axes.tolist()
    bx, by, bz = gate * m0 * (px - k_s * sx), gate * m1 * (py - k_s * sy), gate * m2 * (pz - k_s * sz)
    nx = gate * m3 * (dx - k_s * tx - r00 * hxx - r10 * hyy - r20 * hzz)
    ny = gate * m4 * (dy - k_s * ty - r01 * hxx - r11 * hyy - r21 * hzz)
    nz = gate * m5 * (dz - k_s * tz - r02 * hxx - r12 * hyy - r22 * hzz)
    if tuning.spin_limit != math.inf:
        size = math.sqrt(nx * nx + ny * ny + nz * nz)
        if size > tuning.spin_limit:
            k = tuning.spin_limit / size
            nx, ny, nz = k * nx, k * ny, k * nz
    a_C = np.array((
        jx + zx + r00 * bx + r01 * by + r02 * bz,
        jy + zy + r10 * bx + r11 * by + r12 * bz,
        jz + zz + r20 * bx + r21 * by + r22 * bz,
        lx + ox + hxx + r00 * nx + r01 * ny + r02 * nz,
        ly + oy + hyy + r10 * nx + r11 * ny + r12 * nz,
        lz + oz + hzz + r20 * nx + r21 * ny + r22 * nz,
    ))  # fmt: skip
    return FastTerms(
        a_C,
        np.array((hx, hy, hz, kx, ky, kz)),
        np.array((ex, ey, ez)),
        angle > LOG_REPORT,
        gate,
        math.sqrt(x * x + y * y + z * z),
        angle,
        math.sqrt(linear),
        np.array((r00 * ax + r01 * ay + r02 * az, r10 * ax + r11 * ay + r12 * az, r20 * ax + r21 * ay + r22 * az)),
        np.array((r00 * px + r01 * py + r02 * pz, r10 * px + r11 * py + r12 * pz, r20 * px + r21 * py + r22 * pz)),
    )


def _arm(pad: list[list[float]], contact: Contact, slip: SlipDisplacement) -> Numbers:
    """Return r = x_c - x_o of a contact on the axes of the own pad, from which `pad` leads to {o}."""
    px, py, pz = contact.position.tolist()
    x, y, z = slip.position.tolist()
    (a, b, c), (d, e, f), (g, h, i) = contact.rotation.tolist()
    return _turned_back(pad, px + a * x + b * y + c * z, py + d * x + e * y + f * z, pz + g * x + h * y + i * z)


def _turned_back(rotation: list[list[float]], x: float, y: float, z: float) -> Numbers:
    """Return rotation^T (x, y, z)."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z


def _other_wrench(pad: list[list[float]], contact: Contact, slip: SlipDisplacement, wrench: Array) -> Numbers:
    """Return G_i h_ee,i of a contact of another arm, on the axes of the own pad at the object's centre of mass."""
    (a, b, c), (d, e, f), (g, h, i) = contact.rotation.dot(slip.rotation).tolist()
    fx, fy, fz, nx, ny, nz = wrench.tolist()
    fx, fy, fz = _turned_back(pad, a * fx + b * fy + c * fz, d * fx + e * fy + f * fz, g * fx + h * fy + i * fz)
    nx, ny, nz = _turned_back(pad, a * nx + b * ny + c * nz, d * nx + e * ny + f * nz, g * nx + h * ny + i * nz)
    rx, ry, rz = _arm(pad, contact, slip)
    return fx, fy, fz, nx + ry * fz - rz * fy, ny + rz * fx - rx * fz, nz + rx * fy - ry * fx


_ZEROS = (0.0,) * 6
