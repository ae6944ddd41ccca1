"""One axis of the slip observer: a Kalman filter for slip velocity and two model errors.

State x = (v, b, c) with covariance P: slip velocity; constant error of the predicted object acceleration, from a wrench
bias; and its error in proportion to the measured specific force f, from a wrong mass or inertia:

    v[k+1] = v[k] + step - dt (b + c f) + w_v,   b[k+1] = b[k] + w_b,   c[k+1] = c[k]

Axes are filtered separately: their coupling (rotation of the pad) is small over the filter's memory, and is part
of `step`. The covariance is symmetric, so six numbers hold it, and F P F^T + Q is written out.

On pad axes; v in m/s (linear) or rad/s (angular), b in m/s^2 or rad/s^2, c without unit.
"""

from __future__ import annotations

import math

from slip_core.compiled import part
from slip_core.records import Real, Record


class Axis(Record):
    """Estimate (v, b, c) of one axis and its covariance P."""

    v: Real  # m/s or rad/s; slip velocity
    b: Real  # m/s^2 or rad/s^2; constant error of the predicted acceleration
    c: Real  # its error in proportion to the specific force
    P_vv: Real
    P_vb: Real
    P_vc: Real
    P_bb: Real
    P_bc: Real
    P_cc: Real


RARE = 1e-6
"""Probability of the dead band below which only its near edge matters."""
_SQRT_HALF = math.sqrt(0.5)
_INVERSE_SQRT_TWO_PI = 1.0 / math.sqrt(2.0 * math.pi)


@part
def put_velocity(x: Axis, v: float, P_vv: float) -> None:
    """Set the slip velocity, uncorrelated with the model's errors."""
    x.v, x.P_vv, x.P_vb, x.P_vc = v, P_vv, 0.0, 0.0


@part
def forget_errors(x: Axis, P_bb: float, P_cc: float) -> None:
    """Reset the uncertainty of the model's errors to its initial value; the estimates stay."""
    x.P_vb, x.P_vc, x.P_bb, x.P_bc, x.P_cc = 0.0, 0.0, P_bb, 0.0, P_cc


@part
def predict(x: Axis, step: float, f: float, dt: float, q_v: float, q_b: float) -> None:
    """Predict the estimate over one tick: x <- F x + u, P <- F P F^T + Q.

    F = [[1, -dt, -dt f], [0, 1, 0], [0, 0, 1]], u = (step, 0, 0), Q = diag(q_v, q_b, 0).

    Args:
        x: the estimate; changed.
        step: change of the slip velocity as the uncorrected model has it [m/s or rad/s].
        f: specific force that the proportional error acts on [m/s^2 or rad/s^2].
        dt: time since `x` [s].
        q_v: variance that process noise adds to v in this time.
        q_b: variance that drift adds to b in this time.
    """
    u_b = x.P_bb + f * x.P_bc  # covariance of the acceleration error b + c f with b
    u_c = x.P_bc + f * x.P_cc  # and with c
    x.v = x.v + step - dt * (x.b + x.c * f)
    x.P_vv += dt * (dt * (u_b + f * u_c) - 2.0 * (x.P_vb + f * x.P_vc)) + q_v
    x.P_vb -= dt * u_b
    x.P_vc -= dt * u_c
    x.P_bb += q_b


@part
def correct(x: Axis, z: float, R: float) -> None:
    """Correct with a measurement z of v, variance R: Kalman's correction with H = (1, 0, 0)."""
    S, innovation = x.P_vv + R, z - x.v
    k_v, k_b, k_c = x.P_vv / S, x.P_vb / S, x.P_vc / S
    left = R / S  # 1 - k_v without the loss of digits
    x.v += k_v * innovation
    x.b += k_b * innovation
    x.c += k_c * innovation
    x.P_bb -= k_b * x.P_vb
    x.P_bc -= k_b * x.P_vc
    x.P_cc -= k_c * x.P_vc
    x.P_vv *= left
    x.P_vb *= left
    x.P_vc *= left


@part
def correct_within(x: Axis, band: float, R: float) -> None:
    """Correct with a reading of zero: a measurement, variance R, that lies within +-`band` [m/s or rad/s].

    The posterior has mean and variance of a truncated normal distribution, obtained from an equivalent measurement
    whose innovation and variance are computed here.
    """
    S = x.P_vv + R
    deviation = math.sqrt(S)
    low, high = (-band - x.v) / deviation, (band - x.v) / deviation
    inside = 0.5 * (math.erf(high * _SQRT_HALF) - math.erf(low * _SQRT_HALF))
    if inside < RARE:  # so far outside that only the near edge matters
        correct(x, math.copysign(band, x.v), R)
        return
    at_low = math.exp(-0.5 * low * low) * _INVERSE_SQRT_TWO_PI
    at_high = math.exp(-0.5 * high * high) * _INVERSE_SQRT_TWO_PI
    shift = (at_low - at_high) / inside
    gain = shift * shift - (low * at_low - high * at_high) / inside  # 1 - variance over S; 1 of a plain measurement
    if gain > 0.0:
        correct(x, x.v + shift * deviation / gain, S / gain - x.P_vv)


@part
def excess(x: Axis, z: float, R: float, limit: float) -> float:
    """Return by how much the square of an innovation exceeds that of `limit` standard deviations, 0 where it does not.

    Added to R over limit^2, it bounds the pull of an outlier to that of `limit` deviations; a lasting one prevails.
    """
    innovation = z - x.v
    return max(innovation * innovation - limit * limit * (x.P_vv + R), 0.0)
