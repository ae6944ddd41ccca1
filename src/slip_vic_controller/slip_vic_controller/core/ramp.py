"""Gains and payload that change at run time: from the old values to the new ones, slowly enough to stay stable.

The argument is that of variable impedance with V = 1/2 |e_dot + a e|^2 + 1/2 e^T (k + a d - a^2) e as Lyapunov function
per axis, where k = K/M, d = D/M and 0 < a <= d: along e_ddot = -d e_dot - k e it does not grow while
k_dot + a d_dot <= 2 a k. Here a = d/2 of the softer end, and k_dot <= a k, d_dot <= k: half of the bound for each.
V_s = 1/2 v_s^T v_s needs nothing: its decay rate k_s may have any positive value at any time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array, readonly
from slip_vic_controller.core.impedance import Gains
from slip_vic_controller.core.object_dynamics import ObjectModel


class Tuning(NamedTuple):
    """What may change at run time: gains, payload, and o_x_p of the own contact (3,) [m] {o}."""

    gains: Gains
    object_model: ObjectModel
    contact_position: Array


class Ramp(NamedTuple):
    """The way from one tuning to another; begin_ns, duration_ns in the time of the joint states."""

    start: Tuning
    target: Tuning
    begin_ns: int
    duration_ns: int

    def after(self, stamp_ns: int) -> Ramp:
        """Return the ramp without its start, once that no longer matters."""
        done = stamp_ns >= self.begin_ns + self.duration_ns and self.start is not self.target
        return self._replace(start=self.target) if done else self


def make_ramp(start: Tuning, target: Tuning, begin_ns: int, least_s: float) -> Ramp:
    """Return the ramp between two tunings, as long as stability asks, and never shorter than `least_s` [s].

    Implements: ours: `ramp_time`.
    """
    return Ramp(start, target, begin_ns, round(1e9 * max(least_s, ramp_time(start.gains, target.gains))))


def ramp_time(start: Gains, target: Gains) -> float:
    """Return the shortest time [s] in which the gains may change geometrically under the module's argument.

    Implements: ours: k_dot <= a k and d_dot <= k on every axis, a = d/2.
    """
    k = np.stack((start.K_D / start.M_D, target.K_D / target.M_D))
    d = np.stack((start.D_D / start.M_D, target.D_D / target.M_D))
    rise_k = np.maximum(np.log(k[1] / k[0]), 0.0)
    rise_d = np.maximum(np.log(d[1] / d[0]), 0.0)
    a = 0.5 * d.min(axis=0)
    return float(np.max(np.maximum(rise_k / a, rise_d * d.max(axis=0) / k.min(axis=0))))


def tuning_at(ramp: Ramp, stamp_ns: int) -> Tuning:
    """Return the tuning in effect at a time; at both ends exactly the given values.

    Implements: ours: gains and mass change geometrically, what may be zero or signed linearly.
    """
    if stamp_ns >= ramp.begin_ns + ramp.duration_ns:
        return ramp.target
    if stamp_ns <= ramp.begin_ns:
        return ramp.start
    share = (stamp_ns - ramp.begin_ns) / ramp.duration_ns
    a, b = ramp.start, ramp.target
    gains = Gains(
        K_D=_geometric(a.gains.K_D, b.gains.K_D, share),
        D_D=_geometric(a.gains.D_D, b.gains.D_D, share),
        M_D=_geometric(a.gains.M_D, b.gains.M_D, share),
        gamma_k=_linear(a.gains.gamma_k, b.gains.gamma_k, share),
        gamma_d=_linear(a.gains.gamma_d, b.gains.gamma_d, share),
        alpha=a.gains.alpha + share * (b.gains.alpha - a.gains.alpha),
        k_s=a.gains.k_s + share * (b.gains.k_s - a.gains.k_s),
        spin_lever=a.gains.spin_lever + share * (b.gains.spin_lever - a.gains.spin_lever),
        spin_limit=_finite_linear(a.gains.spin_limit, b.gains.spin_limit, share),
    )
    model = ObjectModel(
        mass=a.object_model.mass ** (1.0 - share) * b.object_model.mass**share,
        inertia=_linear(a.object_model.inertia, b.object_model.inertia, share),
        gravity=b.object_model.gravity,
    )
    return Tuning(gains, model, _linear(a.contact_position, b.contact_position, share))


def _geometric(a: Array, b: Array, share: float) -> Array:
    return readonly(a * (b / a) ** share)


def _linear(a: Array, b: Array, share: float) -> Array:
    return readonly(a + share * (b - a))


def _finite_linear(a: float, b: float, share: float) -> float:
    return a + share * (b - a) if math.isfinite(a) and math.isfinite(b) else b
