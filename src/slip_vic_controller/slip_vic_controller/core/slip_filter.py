"""One axis of the slip observer: a Kalman filter of slip velocity and of the model's two errors, in plain floats.

State (v, b, c): slip velocity; constant error of the predicted object acceleration, from a wrench bias; and its error
in proportion to the measured specific force f, from a wrong mass or inertia. Axes are filtered apart: what couples them
(the turning of the pad) is small over the time the filter remembers, and is in the prediction that it is given.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class AxisFilter(NamedTuple):
    """Estimate and covariance of one axis; v [m/s or rad/s], b [m/s^2 or rad/s^2], c [1], P_xy their covariances."""

    v: float
    b: float
    c: float
    P_vv: float
    P_vb: float
    P_vc: float
    P_bb: float
    P_bc: float
    P_cc: float


def predict(x: AxisFilter, step: float, f: float, dt: float, q_v: float, q_b: float) -> AxisFilter:
    """Return the estimate one tick later.

    Args:
        x: the estimate.
        step: change of the slip velocity as the uncorrected model has it; [m/s or rad/s].
        f: specific force that the proportional error acts on; [m/s^2 or rad/s^2].
        dt: time since `x` [s].
        q_v: variance that noise adds to v in this time.
        q_b: variance that drift adds to b in this time.

    Implements: ours: v += step - dt (b + c f); b, c constant. F P F^T + Q by hand, which spares nine tiny matrices.
    """
    v, b, c, P_vv, P_vb, P_vc, P_bb, P_bc, P_cc = x
    u_b = P_bb + f * P_bc  # covariance of the acceleration error b + c f with b
    u_c = P_bc + f * P_cc  # and with c
    P_vv += dt * (dt * (u_b + f * u_c) - 2.0 * (P_vb + f * P_vc)) + q_v
    return AxisFilter(v + step - dt * (b + c * f), b, c, P_vv, P_vb - dt * u_b, P_vc - dt * u_c, P_bb + q_b, P_bc, P_cc)


def correct(x: AxisFilter, measured: float, variance: float) -> AxisFilter:
    """Return the estimate with a measurement of v taken in; [m/s or rad/s] and its square.

    Implements: ours: Kalman correction with H = (1, 0, 0).
    """
    v, b, c, P_vv, P_vb, P_vc, P_bb, P_bc, P_cc = x
    S = P_vv + variance
    k_v, k_b, k_c = P_vv / S, P_vb / S, P_vc / S
    innovation = measured - v
    left = variance / S  # 1 - k_v without the loss of digits
    return AxisFilter(
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


def learn(x: AxisFilter, step: float, f: float, dt: float, q_v: float, q_b: float) -> AxisFilter:
    """Return the estimate after a tick in stick: v is zero before and after, so `step` is the model's error alone.

    Implements: ours: `predict` from v = 0 without variance, then `correct` with v = 0 measured exactly.
    """
    H_b, H_c = dt, dt * f
    u_b = H_b * x.P_bb + H_c * x.P_bc
    u_c = H_b * x.P_bc + H_c * x.P_cc
    S = H_b * u_b + H_c * u_c + q_v
    innovation = step - (H_b * x.b + H_c * x.c)
    k_b, k_c = u_b / S, u_c / S
    return AxisFilter(
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


def robust_variance(x: AxisFilter, measured: float, variance: float, limit: float) -> float:
    """Return the variance to use for a measurement: larger where it lies more than `limit` deviations away.

    Implements: ours: an outlier pulls with the force of `limit` deviations, never more, and a lasting one prevails.
    """
    S = x.P_vv + variance
    excess = (measured - x.v) ** 2 - limit * limit * S
    return variance if excess <= 0.0 else variance + excess / (limit * limit)


def correct_within(x: AxisFilter, band: float, variance: float) -> AxisFilter:
    """Return the estimate with the knowledge taken in that a measurement lies within +-`band`, whatever it is.

    Args:
        x: the estimate.
        band: half width of the sensor's dead band, in the unit of v.
        variance: of the measurement.

    Implements: ours: Kalman correction with mean and variance of the truncated normal distribution.
    """
    S = x.P_vv + variance
    deviation = math.sqrt(S)
    low, high = (-band - x.v) / deviation, (band - x.v) / deviation
    inside = 0.5 * (math.erf(high * _SQRT_HALF) - math.erf(low * _SQRT_HALF))
    if inside < _RARE:
        # So far outside that only the near edge matters.
        return correct(x, math.copysign(band, x.v), variance)
    at_low, at_high = _density(low), _density(high)
    shift = (at_low - at_high) / inside
    spread = 1.0 + (low * at_low - high * at_high) / inside - shift * shift
    gain = (1.0 - spread) / S  # of the variance; a plain correction has spread 0
    k_v, k_b, k_c = x.P_vv, x.P_vb, x.P_vc
    move = shift / deviation
    return AxisFilter(
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


def _density(z: float) -> float:
    return math.exp(-0.5 * z * z) * _INVERSE_SQRT_TWO_PI


_SQRT_HALF = math.sqrt(0.5)
_INVERSE_SQRT_TWO_PI = 1.0 / math.sqrt(2.0 * math.pi)
_RARE = 1e-6
