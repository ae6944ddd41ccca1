"""Gains and payload: the numbers that the law works with, made from parameters, and how they change at run time.

A change is a ramp, slow enough to stay stable. The argument is that of variable impedance with the Lyapunov function
V = 1/2 |e_dot + a e|^2 + 1/2 e^T (k + a d - a^2) e per axis, where k = K/M, d = D/M and 0 < a <= d: along
e_ddot = -d e_dot - k e it does not grow while k_dot + a d_dot <= 2 a k. Here a = d/2 of the softer end, and
k_dot <= a k, d_dot <= k: half of the bound for each. V_s = 1/2 v_s^T v_s needs nothing: its decay rate k_s may have any
positive value at any time.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slip_core.arrays import Array, inertia_from_six, vector
from slip_core.compiled import IN1, INT, OUT1, VOID, kernel, part
from slip_core.records import REAL, WHOLE, layout, new, record
from slip_vic_controller.law.bounds import GainReport, check_gains, judge_gains
from slip_vic_controller.params import ControllerParams, GainParams

GAINS = layout(
    K_D=(REAL, (6,)),
    gamma_k=(REAL, (6,)),
    D_D=(REAL, (6,)),
    gamma_d=(REAL, (6,)),
    M_D=(REAL, (6,)),
    alpha=REAL,
    k_s=REAL,
    characteristic_length=REAL,
    spin_limit=REAL,
    kappa=REAL,
)
"""Gains of the law, diagonals as vectors, linear part first.

K_D [N/m, N m/rad]; D_D [N s/m, N m s/rad]; M_D [kg, kg m2]; gamma_k, gamma_d [s/m, s/rad]; alpha [s/m]; k_s [1/s].
characteristic_length [m]: what makes turning a slip speed in the slip activation; spin_limit [rad/s^2]: most that the
compensation may turn; printed: 1 and infinite; kappa: share of the
internal wrench that the pad gives way to, printed: 0. Classical impedance control has alpha = 0 and gamma = 0.
"""

OBJECT = layout(mass=REAL, inertia=(REAL, (3, 3)), gravity=(REAL, (3,)))
"""What is known of the object: mass [kg]; inertia [kg m2] {o} about the centre of mass; gravity [m/s^2] {w}."""

LAW_GAINS = layout(gains=GAINS, object=OBJECT, contact_position=(REAL, (3,)))
"""What may change at run time: gains, payload, and o_x_p of contact 0 [m] {o}, which moves with the payload."""

RAMP = layout(start=LAW_GAINS, target=LAW_GAINS, begin_ns=WHOLE, duration_ns=WHOLE, active=WHOLE)
"""The way from one set of gains to another, in the time of the joint states; not active: `target` is in effect."""


def make_law_gains(params: ControllerParams, k_s: float) -> Array:
    """Return LAW_GAINS of the parameters, with the k_s [1/s] that `gain_report` found.

    Raises:
        InputError: an inertia that no body can have.
    """
    buffer = new(LAW_GAINS)
    out = record(buffer, LAW_GAINS)
    axes = np.array(params.contacts.slip_axes[:6], dtype=float)
    fill_gains(params.gains, axes, k_s, out.gains, classical=params.controller == "classical")
    out.object.mass = params.object.mass
    out.object.inertia[:] = inertia_from_six(params.object.inertia, "parameter object.inertia")
    out.object.gravity[:] = vector(params.gravity, 3, "gravity")
    out.contact_position[:] = params.contacts.position[:3]
    return buffer


def fill_gains(params: GainParams, slip_axes: Array, k_s: float, gains: Any, *, classical: bool) -> None:
    """Write GAINS; classical impedance control has slip activation and fading off.

    With spin bounded, the angular stiffness does not fade, and the compensation turns no faster than the stiffness of
    the softest axis that can slip takes back at `spin_excursion`; slip_axes (6,) 0 or 1 on pad axes.
    """
    on = 0.0 if classical else 1.0
    bounded = params.spin == "bounded"
    turning = 0.0 if bounded else on
    gains.K_D[:], gains.D_D[:], gains.M_D[:] = params.stiffness, params.damping, params.inertia
    gains.gamma_k[:] = [on * params.gamma_kp] * 3 + [turning * params.gamma_ko] * 3
    gains.gamma_d[:] = [on * params.gamma_dp] * 3 + [turning * params.gamma_do] * 3
    gains.alpha, gains.k_s, gains.kappa = on * params.alpha, k_s, params.kappa
    gains.characteristic_length = params.characteristic_length if bounded else 1.0
    ratio = (gains.K_D / gains.M_D)[3:][slip_axes[3:] > 0.0]
    gains.spin_limit = float(ratio.min()) * params.spin_excursion if bounded and ratio.size else math.inf


def gain_report(params: ControllerParams, *, refuse: bool = True) -> GainReport:
    """Return the verdict on the gains of the configured slip loop; an observer takes the sensor's delays out of it.

    Raises:
        InputError: where `refuse`, a k_s that is fixed beyond its bound, or damping for which a proposition has no
            lambda.
    """
    direct = params.slip_estimator == "measured"
    unsafe = refuse and params.controller != "classical"  # without a slip loop nothing is
    judge = check_gains if unsafe else judge_gains
    return judge(
        np.array(params.gains.damping),
        params.gains.k_s,
        params.gains.k_s_mode,
        gain_margin=params.gains.k_s_margin,
        control_period_s=params.control_period_s,
        sensor_period_s=params.slip_sensor.period_s if direct else 0.0,
        latency_s=params.slip_sensor.latency_s if direct else 0.0,
    )


def steady(gains: Array) -> Array:
    """Return the RAMP that stays at a LAW_GAINS."""
    buffer = new(RAMP)
    ramp, given = record(buffer, RAMP), record(gains, LAW_GAINS)
    ramp.start, ramp.target = given, given
    return buffer


def make_ramp(start: Array, target: Array, begin_ns: int, least_s: float) -> Array:
    """Return the RAMP between two LAW_GAINS, as long as stability asks, and never shorter than `least_s` [s]."""
    buffer = new(RAMP)
    ramp = record(buffer, RAMP)
    ramp.start, ramp.target = record(start, LAW_GAINS), record(target, LAW_GAINS)
    ramp.begin_ns, ramp.active = begin_ns, 1
    ramp.duration_ns = round(1e9 * max(least_s, ramp_time(start, target)))
    return buffer


def ramp_time(start: Array, target: Array) -> float:
    """Return the shortest time [s] in which one LAW_GAINS may change into another under the module's argument."""
    a, b = record(start, LAW_GAINS).gains, record(target, LAW_GAINS).gains
    k = np.stack((a.K_D / a.M_D, b.K_D / b.M_D))
    d = np.stack((a.D_D / a.M_D, b.D_D / b.M_D))
    rise_k = np.maximum(np.log(k[1] / k[0]), 0.0)
    rise_d = np.maximum(np.log(d[1] / d[0]), 0.0)
    half = 0.5 * d.min(axis=0)
    return float(np.max(np.maximum(rise_k / half, rise_d * d.max(axis=0) / k.min(axis=0))))


@part
def gains_at(ramp: Any, stamp_ns: int, out: Any) -> None:
    """Write the gains in effect at a time: at both ends exactly the given ones; RAMP, [ns], LAW_GAINS.

    Gains and mass change geometrically, what may be zero or signed linearly, gravity at once.
    """
    if ramp.active == 0 or stamp_ns >= ramp.begin_ns + ramp.duration_ns:
        copy_gains(ramp.target, out)
    elif stamp_ns <= ramp.begin_ns:
        copy_gains(ramp.start, out)
    else:
        share = (stamp_ns - ramp.begin_ns) / ramp.duration_ns
        a, b, g = ramp.start.gains, ramp.target.gains, out.gains
        for j in range(6):
            g.K_D[j] = _geometric(a.K_D[j], b.K_D[j], share)
            g.D_D[j] = _geometric(a.D_D[j], b.D_D[j], share)
            g.M_D[j] = _geometric(a.M_D[j], b.M_D[j], share)
            g.gamma_k[j] = _linear(a.gamma_k[j], b.gamma_k[j], share)
            g.gamma_d[j] = _linear(a.gamma_d[j], b.gamma_d[j], share)
        g.alpha, g.k_s = _linear(a.alpha, b.alpha, share), _linear(a.k_s, b.k_s, share)
        g.kappa = _linear(a.kappa, b.kappa, share)
        g.characteristic_length = _linear(a.characteristic_length, b.characteristic_length, share)
        bounded = math.isfinite(a.spin_limit) and math.isfinite(b.spin_limit)
        g.spin_limit = _linear(a.spin_limit, b.spin_limit, share) if bounded else b.spin_limit
        out.object.mass = ramp.start.object.mass ** (1.0 - share) * ramp.target.object.mass**share
        for i in range(3):
            for j in range(3):
                start, target = ramp.start.object.inertia[i, j], ramp.target.object.inertia[i, j]
                out.object.inertia[i, j] = _linear(start, target, share)
            out.object.gravity[i] = ramp.target.object.gravity[i]
            out.contact_position[i] = _linear(ramp.start.contact_position[i], ramp.target.contact_position[i], share)


@part
def _geometric(a: float, b: float, share: float) -> float:
    return a * (b / a) ** share


@part
def _linear(a: float, b: float, share: float) -> float:
    return a + share * (b - a)


@part
def copy_gains(given: Any, out: Any) -> None:
    """Write one LAW_GAINS to another."""
    a, b = given.gains, out.gains
    for j in range(6):
        b.K_D[j], b.D_D[j], b.M_D[j] = a.K_D[j], a.D_D[j], a.M_D[j]
        b.gamma_k[j], b.gamma_d[j] = a.gamma_k[j], a.gamma_d[j]
    b.alpha, b.k_s, b.spin_limit, b.kappa = a.alpha, a.k_s, a.spin_limit, a.kappa
    b.characteristic_length = a.characteristic_length
    out.object.mass = given.object.mass
    for i in range(3):
        for j in range(3):
            out.object.inertia[i, j] = given.object.inertia[i, j]
        out.object.gravity[i] = given.object.gravity[i]
        out.contact_position[i] = given.contact_position[i]


@kernel(VOID(IN1, INT, OUT1))
def sample_gains(ramp: Array, stamp_ns: int, out: Array) -> None:
    """Write the gains in effect at a time to a LAW_GAINS; ramp: RAMP."""
    gains_at(record(ramp, RAMP), stamp_ns, record(out, LAW_GAINS))
