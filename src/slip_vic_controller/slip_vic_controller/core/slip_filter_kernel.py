"""One axis of the slip observer: a Kalman filter of slip velocity and of the model's two errors, in plain floats.

State (v, b, c): slip velocity; constant error of the predicted object acceleration, from a wrench bias; and its error
in proportion to the measured specific force f, from a wrong mass or inertia. Axes are filtered apart: what couples them
(the turning of the pad) is small over the time the filter remembers, and is in the prediction that it is given.

Scalars throughout, so the same functions serve as the plain form and, as `..._of`, as parts of kernels.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from slip_core.compiled import part


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
    inside = share_inside(x, band, variance)
    if inside < RARE:
        # So far outside that only the near edge matters.
        return correct(x, math.copysign(band, x.v), variance)
    return truncated(x, band, variance, inside)


def share_inside(x: AxisFilter, band: float, variance: float) -> float:
    """Return the probability of a measurement within +-`band`; arguments of `correct_within`.

    Implements: ours: Phi(high) - Phi(low) of the normal distribution.
    """
    deviation = math.sqrt(x.P_vv + variance)
    low, high = (-band - x.v) / deviation, (band - x.v) / deviation
    return 0.5 * (math.erf(high * _SQRT_HALF) - math.erf(low * _SQRT_HALF))


def truncated(x: AxisFilter, band: float, variance: float, inside: float) -> AxisFilter:
    """Return `correct_within` where the share `inside` of the band is not tiny.

    Implements: ours: moments of the truncated normal distribution.
    """
    S = x.P_vv + variance
    deviation = math.sqrt(S)
    low, high = (-band - x.v) / deviation, (band - x.v) / deviation
    at_low = math.exp(-0.5 * low * low) * _INVERSE_SQRT_TWO_PI
    at_high = math.exp(-0.5 * high * high) * _INVERSE_SQRT_TWO_PI
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


RARE = 1e-6
"""Share of the band below which only its near edge matters."""
_SQRT_HALF = math.sqrt(0.5)
_INVERSE_SQRT_TWO_PI = 1.0 / math.sqrt(2.0 * math.pi)

predict_of, correct_of, learn_of = part(predict), part(correct), part(learn)
robust_variance_of, share_inside_of, truncated_of = part(robust_variance), part(share_inside), part(truncated)


@part
def correct_within_of(x: AxisFilter, band: float, variance: float) -> AxisFilter:
    """Return `correct_within`."""
    inside = share_inside_of(x, band, variance)
    if inside < RARE:
        return correct_of(x, math.copysign(band, x.v), variance)
    return truncated_of(x, band, variance, inside)
