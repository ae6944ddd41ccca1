"""Gains and payload of the law, from the parameters, and how they change at run time.

A change is a ramp, slow enough to stay stable. The argument is that of variable impedance with the Lyapunov function
V = 1/2 |e_dot + a e|^2 + 1/2 e^T (k + a d - a^2) e per axis, where k = K/M, d = D/M and 0 < a <= d: along
e_ddot = -d e_dot - k e it does not grow while k_dot + a d_dot <= 2 a k. Here a = d/2 of the softer end, and
k_dot <= a k, d_dot <= k: half of the bound for each. V_s = 1/2 v_s^T v_s needs nothing: its decay rate k_s may have any
positive value at any time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slip_core.arrays import Array, inertia_from_six, vector
from slip_core.compiled import interpreted, part
from slip_core.records import Mat3, Real, Record, Vec3, Vec6, Whole, dtype_of, new, record
from slip_vic_controller.law.bounds import Condition, GainReport, check, judge_gains, judge_stiffness, slip_gain_limit
from slip_vic_controller.params.controller_params import ControllerParams

UNKNOWN_LAG = 0.3
"""Uncertain fraction of the configured lag of drives, which remains in the slip loop if slip is predicted: the object's
motion is predicted over the rest, since a pad that runs ahead slips in the opposite direction."""


WRIST_SHARE = 0.1
"""Share of the object's inertia below which that of a joint is too small to be all there is: a URDF leaves out its
rotor."""
LEAST_DELAY_S = 0.004
"""Least time assumed from an effort to the motion of a real arm [s]: four control periods at 1 kHz, for the way to the
drives, their own loop, and the unconfigured part of both."""


class Gains(Record):
    """Gains of the law, diagonals as vectors, linear part first.

    Classical impedance control has alpha = 0 and gamma = 0.
    """

    K_D: Vec6  # N/m, N m/rad
    gamma_k: Vec6  # s/m, s/rad; fading of K
    D_D: Vec6  # N s/m, N m s/rad
    gamma_d: Vec6  # s/m, s/rad; fading of D
    M_D: Vec6  # kg, kg m2
    alpha: Real  # s/m
    k_s: Real  # 1/s
    characteristic_length: Real  # m; makes turning a slip speed in the slip activation, printed: 1
    spin_limit: Real  # rad/s^2; most that the compensation may turn, printed: infinite
    kappa: Real  # share of the internal wrench to which the pad yields, printed: 0


class ObjectModel(Record):
    """The object as configured."""

    mass: Real  # kg
    inertia: Mat3  # kg m2 {o}; about the centre of mass
    gravity: Vec3  # m/s^2 {w}


class LawGains(Record):
    """What may change at run time."""

    gains: Gains
    object: ObjectModel
    contact_position: Vec3  # m {o}; o_x_p of contact 0, which moves with the payload


LAW_GAINS = dtype_of(LawGains)


class Ramp(Record):
    """The way from one set of gains to another, in the time of the joint states."""

    start: LawGains
    target: LawGains
    begin_ns: Whole
    duration_ns: Whole


def make_law_gains(params: ControllerParams, k_s_limit: float) -> Array:
    """Return LAW_GAINS of the parameters, with k_s at most a limit [1/s].

    Raises:
        InputError: an inertia that no body can have.
    """
    buffer = new(LAW_GAINS)
    out: LawGains = record(buffer, LAW_GAINS)
    given, gains, slip_axes = params.gains, out.gains, np.array(params.contacts.slip_axes[:6], dtype=float)
    gains.K_D[:], gains.D_D[:], gains.M_D[:] = given.stiffness, given.damping, given.inertia
    gains.gamma_k[:] = [given.gamma_kp] * 3 + [given.gamma_ko] * 3
    gains.gamma_d[:] = [given.gamma_dp] * 3 + [given.gamma_do] * 3
    gains.alpha, gains.k_s, gains.kappa = given.alpha, given.k_s, given.kappa
    gains.characteristic_length = given.characteristic_length
    spin_excursion = given.spin_excursion if given.spin == "bounded" else math.inf
    interpreted(adapt)(gains, params.controller == "classical", spin_excursion, slip_axes, k_s_limit)
    interpreted(slow_down)(gains, params.fastest_rate)
    out.object.mass = params.object.mass
    out.object.inertia[:] = inertia_from_six(params.object.inertia, "parameter object.inertia")
    out.object.gravity[:] = vector(params.gravity, 3, "gravity")
    out.contact_position[:] = params.contacts.position[:3]
    return buffer


@part
def adapt(gains: Gains, classical: bool, spin_excursion: float, slip_axes: Array, k_s_limit: float) -> None:
    """Adapt gains as configured to the kind of law.

    Classical impedance control has slip activation and fading off. With spin bounded, the angular stiffness does not
    fade, and the compensation turns the pad no faster than the softest slip axis can turn it back.

    Args:
        gains: changed.
        classical: whether it is.
        spin_excursion: largest attitude error from following the spin [rad]; infinite where spin is not bounded.
        slip_axes: of the own contact (6,), 0 or 1.
        k_s_limit: largest k_s [1/s].
    """
    bounded, softest = spin_excursion < math.inf, math.inf
    for j in range(6):
        if classical or (bounded and j >= 3):
            gains.gamma_k[j] = gains.gamma_d[j] = 0.0
        if j >= 3 and slip_axes[j] != 0.0:
            softest = min(softest, gains.K_D[j] / gains.M_D[j])
    gains.alpha = 0.0 if classical else gains.alpha
    gains.k_s = min(gains.k_s, k_s_limit)
    gains.characteristic_length = gains.characteristic_length if bounded else 1.0
    gains.spin_limit = softest * spin_excursion if bounded and softest < math.inf else math.inf


@part
def slow_down(gains: Gains, fastest: float) -> None:
    """Slow the impedance to what drives can follow: D/M at most `fastest` [1/s], K with the same damping ratio.

    Implements: ours: M s^2 + D s + K in slow motion, axis by axis.
    """
    for j in range(6):
        slower = min(1.0, fastest * gains.M_D[j] / gains.D_D[j])
        gains.D_D[j] *= slower
        gains.K_D[j] *= slower * slower


def gain_report(params: ControllerParams, *, refuse: bool = True) -> GainReport:
    """Return the verdict on the gains of the configured slip loop, with the delays of slip sensor and drives.

    An observer compensates the sensor's delays, and the prediction of slip the known part of the drives'. The stiffness
    in effect is judged with one period and the delay that remains after the prediction of the joints.

    Raises:
        InputError: an inertia that no body can have; if `refuse`, damping or a k_s for which a proposition has no
        lambda, or a stiffness that the delays do not admit.
    """
    direct, unknown = params.slip_estimator == "measured", UNKNOWN_LAG if params.foresees_slip else 1.0
    real = params.estimates_joints and params.bounded_authority
    lag_s = max(unknown * params.drive_lag_s, LEAST_DELAY_S if real else 0.0)
    sensor_period_s, latency_s = (params.slip_sensor.period_s, params.slip_sensor.latency_s) if direct else (0.0, 0.0)
    accepted = slip_gain_limit(params.control_period_s, sensor_period_s, latency_s + lag_s) / params.gains.k_s_margin
    made = make_law_gains(params, accepted)
    gains: Gains = record(made, LAW_GAINS).gains
    propositions = judge_gains(np.array(params.gains.damping), gains.k_s)
    stiff = judge_stiffness(gains.K_D, gains.D_D, gains.M_D, impedance_delay_s(params))
    if refuse:
        check(stiff if params.controller == "classical" else (*propositions, *stiff))  # it has no slip loop
    return GainReport(params.gains.k_s, float(gains.k_s), accepted, (*propositions, *stiff), made)


def impedance_delay_s(params: ControllerParams) -> float:
    """Return the delay [s] for which a stiffness is judged: a period, and the lag that joint prediction leaves."""
    late_s = max(UNKNOWN_LAG * params.known_lag_s, LEAST_DELAY_S) if params.estimates_joints else 0.0
    return params.control_period_s + late_s


def judge_inertia(params: ControllerParams, joint_names: Sequence[str], inertia: Array) -> Condition:
    """Judge the inertia that the lightest joint moves, as seen from M_D; inertia (n,) [kg m2], as `Robot` has it.

    The law cancels what is there to put M_D in its place: of next to nothing every error of a torque is a large
    acceleration.
    """
    light, most = int(inertia.argmin()), max(params.gains.inertia[3:])
    least = WRIST_SHARE * min(params.object.inertia[:3])
    reason = (
        f"{joint_names[light]} moves {inertia[light]:.2g} kg m2 beside the object's {least / WRIST_SHARE:.2g}; a "
        "URDF leaves out rotors, which drive.armature adds"
    )
    name = f"M_D over the inertia of {joint_names[light]}"
    return Condition(name, most / max(float(inertia[light]), 1e-12), most / least, reason, "drive.armature")


@part
def fill_ramp(ramp: Ramp, start: LawGains, target: LawGains, begin_ns: int, least_ns: int) -> None:
    """Make the ramp between two sets of gains, as long as stability requires, and never shorter than `least_ns`."""
    ramp.start, ramp.target, ramp.begin_ns = start, target, begin_ns
    ramp.duration_ns = max(least_ns, round(1e9 * ramp_time(ramp)))


@part
def ramp_time(ramp: Ramp) -> float:
    """Return the shortest time [s] in which the start may change into the target, by the module's argument."""
    a, b, longest = ramp.start.gains, ramp.target.gains, 0.0
    for j in range(6):
        k_a, k_b = a.K_D[j] / a.M_D[j], b.K_D[j] / b.M_D[j]
        d_a, d_b = a.D_D[j] / a.M_D[j], b.D_D[j] / b.M_D[j]
        stiffer, damped = max(math.log(k_b / k_a), 0.0), max(math.log(d_b / d_a), 0.0)
        longest = max(longest, stiffer / (0.5 * min(d_a, d_b)), damped * max(d_a, d_b) / min(k_a, k_b))
    return longest


@part
def gains_at(ramp: Ramp, stamp_ns: int, out: LawGains) -> None:
    """Write the gains in effect at a time [ns]: at both ends exactly the given ones.

    Gains and mass change geometrically, what may be zero or signed linearly, gravity at once.
    """
    over = stamp_ns >= ramp.begin_ns + ramp.duration_ns
    if over or stamp_ns <= ramp.begin_ns:
        end = ramp.target if over else ramp.start
        out.gains, out.object, out.contact_position[:] = end.gains, end.object, end.contact_position
    else:
        share = (stamp_ns - ramp.begin_ns) / ramp.duration_ns
        start, target, gains = ramp.start.gains, ramp.target.gains, out.gains
        for j in range(6):
            gains.K_D[j] = _geometric(start.K_D[j], target.K_D[j], share)
            gains.D_D[j] = _geometric(start.D_D[j], target.D_D[j], share)
            gains.M_D[j] = _geometric(start.M_D[j], target.M_D[j], share)
            gains.gamma_k[j] = _linear(start.gamma_k[j], target.gamma_k[j], share)
            gains.gamma_d[j] = _linear(start.gamma_d[j], target.gamma_d[j], share)
        gains.alpha = _linear(start.alpha, target.alpha, share)
        gains.k_s = _linear(start.k_s, target.k_s, share)
        gains.kappa = _linear(start.kappa, target.kappa, share)
        gains.characteristic_length = _linear(start.characteristic_length, target.characteristic_length, share)
        bounded = math.isfinite(start.spin_limit) and math.isfinite(target.spin_limit)
        gains.spin_limit = _linear(start.spin_limit, target.spin_limit, share) if bounded else target.spin_limit
        out.object = ramp.target.object
        out.object.mass = ramp.start.object.mass ** (1.0 - share) * ramp.target.object.mass**share
        for i in range(3):
            for j in range(3):
                a, b = ramp.start.object.inertia[i, j], ramp.target.object.inertia[i, j]
                out.object.inertia[i, j] = _linear(a, b, share)
            out.contact_position[i] = _linear(ramp.start.contact_position[i], ramp.target.contact_position[i], share)


@part
def _geometric(a: float, b: float, share: float) -> float:
    return a * (b / a) ** share


@part
def _linear(a: float, b: float, share: float) -> float:
    return a + share * (b - a)
