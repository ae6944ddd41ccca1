"""One axis of the slip observer: a Kalman filter of slip velocity and of the model's two errors, in plain floats.

State (v, b, c): slip velocity; constant error of the predicted object acceleration, from a wrench bias; and its error in
proportion to the measured specific force f, from a wrong mass or inertia. Axes are filtered apart: what couples them
(the turning of the pad) is small over the time the filter remembers, and is in the prediction that it is given.
"""

from __future__ import annotations

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
    return AxisFilter(
        v + step - dt * (b + c * f), b, c, P_vv, P_vb - dt * u_b, P_vc - dt * u_c, P_bb + q_b, P_bc, P_cc
    )


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


def robust_variance(x: AxisFilter, measured: float, variance: float, limit: float) -> float:
    """Return the variance to use for a measurement: larger where it lies more than `limit` deviations away.

    Implements: ours: an outlier pulls with the force of `limit` deviations, never more, and a lasting one prevails.
    """
    S = x.P_vv + variance
    excess = (measured - x.v) ** 2 - limit * limit * S
    return variance if excess <= 0.0 else variance + excess / (limit * limit)
