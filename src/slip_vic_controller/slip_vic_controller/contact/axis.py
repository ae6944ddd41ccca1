"""One axis of the slip observer: a Kalman filter of slip velocity and of the model's two errors.

State x = (v, b, c) with covariance P: slip velocity; constant error of the predicted object acceleration, from a wrench
bias; and its error in proportion to the measured specific force f, from a wrong mass or inertia:

    v[k+1] = v[k] + step - dt (b + c f) + w_v,   b[k+1] = b[k] + w_b,   c[k+1] = c[k]

Axes are filtered apart: what couples them (the turning of the pad) is small over the time the filter remembers, and is
in the `step` that it is given. The covariance is symmetric, so six numbers hold it, and F P F^T + Q is written out.

On pad axes; v in m/s (linear) or rad/s (angular), b in m/s^2 or rad/s^2, c without unit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slip_core.compiled import part
from slip_core.records import Real, Record, dtype_of


class AxisRecord(Record):
    """An `Axis` in a buffer: estimate and covariance of one axis."""

    v: Real  # m/s or rad/s; slip velocity
    b: Real  # m/s^2 or rad/s^2; constant error of the predicted acceleration
    c: Real  # its error in proportion to the specific force
    P_vv: Real
    P_vb: Real
    P_vc: Real
    P_bb: Real
    P_bc: Real
    P_cc: Real


AXIS = dtype_of(AxisRecord)

RARE = 1e-6
"""Probability of the dead band below which only its near edge matters."""
_SQRT_HALF = math.sqrt(0.5)
_INVERSE_SQRT_TWO_PI = 1.0 / math.sqrt(2.0 * math.pi)


class Axis(NamedTuple):
    """Estimate (v, b, c) of one axis and its covariance P; the numbers of an `AxisRecord`."""

    v: float
    b: float
    c: float
    P_vv: float
    P_vb: float
    P_vc: float
    P_bb: float
    P_bc: float
    P_cc: float


@part
def read_axis(a: AxisRecord) -> Axis:
    """Return the numbers of a record."""
    return Axis(a.v, a.b, a.c, a.P_vv, a.P_vb, a.P_vc, a.P_bb, a.P_bc, a.P_cc)


@part
def put_axis(a: AxisRecord, x: Axis) -> None:
    """Write the numbers to a record."""
    a.v, a.b, a.c = x.v, x.b, x.c
    a.P_vv, a.P_vb, a.P_vc = x.P_vv, x.P_vb, x.P_vc
    a.P_bb, a.P_bc, a.P_cc = x.P_bb, x.P_bc, x.P_cc


@part
def predict(x: Axis, step: float, f: float, dt: float, q_v: float, q_b: float) -> Axis:
    """Return the estimate one tick later: x <- F x + u, P <- F P F^T + Q.

    F = [[1, -dt, -dt f], [0, 1, 0], [0, 0, 1]], u = (step, 0, 0), Q = diag(q_v, q_b, 0).

    Args:
        x: the estimate.
        step: change of the slip velocity as the uncorrected model has it [m/s or rad/s].
        f: specific force that the proportional error acts on [m/s^2 or rad/s^2].
        dt: time since `x` [s].
        q_v: variance that process noise adds to v in this time.
        q_b: variance that drift adds to b in this time.
    """
    v, b, c, P_vv, P_vb, P_vc, P_bb, P_bc, P_cc = x
    u_b = P_bb + f * P_bc  # covariance of the acceleration error b + c f with b
    u_c = P_bc + f * P_cc  # and with c
    P_vv += dt * (dt * (u_b + f * u_c) - 2.0 * (P_vb + f * P_vc)) + q_v
    return Axis(v + step - dt * (b + c * f), b, c, P_vv, P_vb - dt * u_b, P_vc - dt * u_c, P_bb + q_b, P_bc, P_cc)


@part
def correct(x: Axis, z: float, R: float) -> Axis:
    """Return the estimate with a measurement z of v, variance R, taken in: Kalman's correction with H = (1, 0, 0)."""
    v, b, c, P_vv, P_vb, P_vc, P_bb, P_bc, P_cc = x
    S = P_vv + R
    k_v, k_b, k_c = P_vv / S, P_vb / S, P_vc / S
    innovation = z - v
    left = R / S  # 1 - k_v without the loss of digits
    return Axis(
        v + k_v * innovation,
        b + k_b * innovation,
        c + k_c * innovation,
        left * P_vv,
        left * P_vb,
        left * P_vc,
        P_bb - k_b * P_vb,
        P_bc - k_b * P_vc,
        P_cc - k_c * P_vc,
    )


@part
def zero_velocity_update(x: Axis, step: float, f: float, dt: float, q_v: float, q_b: float) -> Axis:
    """Return the estimate after a tick in stick: v is zero before and after it, so `step` is the model's error alone.

    It is `predict` from v = 0 without variance, then `correct` with v = 0 measured exactly; arguments of `predict`.
    """
    H_b, H_c = dt, dt * f
    u_b = H_b * x.P_bb + H_c * x.P_bc
    u_c = H_b * x.P_bc + H_c * x.P_cc
    S = H_b * u_b + H_c * u_c + q_v
    innovation = step - (H_b * x.b + H_c * x.c)
    k_b, k_c = u_b / S, u_c / S
    return Axis(
        0.0,
        x.b + k_b * innovation,
        x.c + k_c * innovation,
        0.0,
        0.0,
        0.0,
        x.P_bb - k_b * u_b + q_b,
        x.P_bc - k_b * u_c,
        x.P_cc - k_c * u_c,
    )


@part
def robust_variance(x: Axis, z: float, R: float, limit: float) -> float:
    """Return the variance to use for a measurement z: more than R where it lies beyond `limit` standard deviations.

    An outlier pulls with the force of `limit` deviations, never more, and a lasting one prevails.
    """
    S = x.P_vv + R
    innovation = z - x.v
    excess = innovation * innovation - limit * limit * S
    return R if excess <= 0.0 else R + excess / (limit * limit)


@part
def contradicts(x: Axis, z: float, R: float, limit: float, band: float) -> bool:
    """Return whether a measurement z, variance R, lies beyond `limit` standard deviations of the estimate.

    band: 0, or where z = 0 only means that the measurement lies within +-`band` [m/s or rad/s].
    """
    beyond = max(abs(z - x.v) - band, 0.0)
    return beyond * beyond > limit * limit * (x.P_vv + R)


@part
def probability_within(x: Axis, band: float, R: float) -> float:
    """Return the probability of a measurement, variance R, within +-`band` [m/s or rad/s]: Phi(high) - Phi(low)."""
    deviation = math.sqrt(x.P_vv + R)
    low, high = (-band - x.v) / deviation, (band - x.v) / deviation
    return 0.5 * (math.erf(high * _SQRT_HALF) - math.erf(low * _SQRT_HALF))


@part
def correct_truncated(x: Axis, band: float, R: float, inside: float) -> Axis:
    """Return the estimate with a measurement somewhere within +-`band` taken in; `inside`: its probability, not tiny.

    Mean and variance of the truncated normal distribution take the place of the measurement's.
    """
    S = x.P_vv + R
    deviation = math.sqrt(S)
    low, high = (-band - x.v) / deviation, (band - x.v) / deviation
    at_low = math.exp(-0.5 * low * low) * _INVERSE_SQRT_TWO_PI
    at_high = math.exp(-0.5 * high * high) * _INVERSE_SQRT_TWO_PI
    shift = (at_low - at_high) / inside
    spread = 1.0 + (low * at_low - high * at_high) / inside - shift * shift
    gain = (1.0 - spread) / S  # of the variance; a plain correction has spread 0
    k_v, k_b, k_c = x.P_vv, x.P_vb, x.P_vc
    move = shift / deviation
    return Axis(
        x.v + k_v * move,
        x.b + k_b * move,
        x.c + k_c * move,
        k_v - gain * k_v * k_v,
        k_b - gain * k_v * k_b,
        k_c - gain * k_v * k_c,
        x.P_bb - gain * k_b * k_b,
        x.P_bc - gain * k_b * k_c,
        x.P_cc - gain * k_c * k_c,
    )


@part
def correct_within(x: Axis, band: float, R: float) -> Axis:
    """Return the estimate with a reading of zero taken in: the measurement, variance R, lies within +-`band`."""
    inside = probability_within(x, band, R)
    if inside < RARE:  # so far outside that only the near edge matters
        return correct(x, math.copysign(band, x.v), R)
    return correct_truncated(x, band, R, inside)
