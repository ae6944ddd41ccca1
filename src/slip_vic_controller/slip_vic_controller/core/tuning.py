"""From parameters to the numbers that the law works with: gains, payload, contacts, and the verdict on the gains."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from slip_core.arrays import Array, inertia_from_six, matrix_from_quat_xyzw, readonly, vector
from slip_vic_controller.core.bounds import GainReport, check_gains, judge_gains
from slip_vic_controller.core.grasp import Contact
from slip_vic_controller.core.impedance import Gains
from slip_vic_controller.core.object_dynamics import ObjectModel
from slip_vic_controller.core.params import ControllerParams, GainParams
from slip_vic_controller.core.ramp import Tuning
from slip_vic_controller.core.slip_params import MeasuredParams


def make_tuning(params: ControllerParams, k_s: float) -> Tuning:
    """Return gains and payload of the parameters, with the k_s [1/s] that `gain_report` found.

    Raises:
        InputError: an inertia that no body can have.

    Implements: ours: one place where parameters become numbers.
    """
    axes = readonly(params.contacts.slip_axes[:6])
    gains = make_gains(params.gains, axes, k_s, classical=params.controller == "classical")
    inertia = readonly(inertia_from_six(params.object.inertia, "parameter object.inertia"))
    model = ObjectModel(params.object.mass, inertia, vector(params.gravity, 3, "gravity"))
    return Tuning(gains, model, readonly(params.contacts.position[:3]))


def make_gains(params: GainParams, slip_axes: Array, k_s: float, *, classical: bool) -> Gains:
    """Return the gains of the law; classical impedance control has gate and fading off.

    With spin bounded, the angular stiffness does not fade, and the compensation turns no faster than the stiffness of
    the softest axis that can slip takes back at `spin_excursion`; slip_axes (6,) 0 or 1 on pad axes.

    Implements: ours: the paper's baseline is the same code with alpha = 0 and gamma = 0.
    """
    on = 0.0 if classical else 1.0
    bounded = params.spin == "bounded"
    turning = 0.0 if bounded else on
    stiffness, inertia = readonly(params.stiffness), readonly(params.inertia)
    ratio = (stiffness / inertia)[3:][slip_axes[3:] > 0.0]
    return Gains(
        K_D=stiffness,
        D_D=readonly(params.damping),
        M_D=inertia,
        gamma_k=readonly([on * params.gamma_kp] * 3 + [turning * params.gamma_ko] * 3),
        gamma_d=readonly([on * params.gamma_dp] * 3 + [turning * params.gamma_do] * 3),
        alpha=on * params.alpha,
        k_s=k_s,
        spin_lever=params.characteristic_length if bounded else 1.0,
        spin_limit=float(ratio.min()) * params.spin_excursion if bounded and ratio.size else math.inf,
    )


def make_contacts(params: ControllerParams) -> tuple[Contact, ...]:
    """Return the contacts from their flat lists; the first is the own arm's.

    Implements: ours: ROS parameters have no nested lists.
    """
    flat = params.contacts
    count = len(flat.position) // 3
    return tuple(
        Contact(
            position=readonly(flat.position[3 * i : 3 * i + 3]),
            rotation=readonly(matrix_from_quat_xyzw(flat.orientation_xyzw[4 * i : 4 * i + 4])),
            slip_axes=readonly(flat.slip_axes[6 * i : 6 * i + 6]),
        )
        for i in range(count)
    )


def moved_contacts(contacts: Sequence[Contact], tuning: Tuning) -> tuple[Contact, ...]:
    """Return the contacts with the own one where the tuning has it; o_x_p changes at run time with the payload's COM.

    Implements: ours: gains and payload change while the law runs.
    """
    return (contacts[0]._replace(position=tuning.contact_position), *contacts[1:])


def gain_report(params: ControllerParams) -> GainReport:
    """Return the verdict on the gains of the configured slip loop; an observer takes the sensor's delays out of it.

    Raises:
        InputError: a k_s that is fixed beyond its bound, or damping for which a proposition has no lambda.

    Implements: ours: gains are safe by construction.
    """
    direct = params.slip_estimator == "measured"
    judge = judge_gains if params.controller == "classical" else check_gains  # without a slip loop nothing is unsafe
    return judge(
        np.array(params.gains.damping),
        params.gains.k_s,
        params.gains.k_s_mode,
        gain_margin=params.gains.k_s_margin,
        control_period_s=params.control_period_s,
        sensor_period_s=params.slip_sensor.period_s if direct else 0.0,
        latency_s=params.slip_sensor.latency_s if direct else 0.0,
    )


def measured_twist(params: MeasuredParams, twist: Array) -> Array:
    """Return a slip sample with zero for what lies in the dead band; (6,) [m/s, rad/s] {ee}, itself without a band.

    Implements: ours: noise of a sensor must not hold the gate open; 0 is the printed law.
    """
    linear, angular = params.dead_band_linear, params.dead_band_angular
    if linear == 0.0 and angular == 0.0:
        return twist
    keep = np.repeat((math.hypot(*twist[:3]) > linear, math.hypot(*twist[3:]) > angular), 3)
    return np.where(keep, twist, 0.0)
