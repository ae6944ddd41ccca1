"""The configuration of the law: contacts, null space, singularity policy, limits."""

from __future__ import annotations

from typing import Annotated

from slip_core.arrays import Array
from slip_core.records import Real, Record, Records, Whole, dtype_of, new, record
from slip_vic_controller.law.attitude import Coordinates
from slip_vic_controller.law.contact import Contact, fill_contacts
from slip_vic_controller.params.controller_params import FOLLOWED_BY_EFFORT, ControllerParams
from slip_vic_controller.sizes import MAX_CONTACTS, Joints


class LawConfig(Record):
    """What does not change while the controller runs."""

    joints: Whole  # in use
    contacts: Whole  # in use
    attitude: Whole  # Coordinates
    nullspace_stiffness: Real  # N m/rad
    nullspace_damping: Real  # N m s/rad
    nullspace_rate: Real  # 1/s; instead of both where drives have loops of their own or could not follow; 0 = without
    sigma_min: Real  # smallest singular value of J below which the torque is damped
    most_damping: Real  # kg^-1/2; the largest damping
    yields: Real  # m; distance from the reference at which the gate is shut; 0 = printed: a_d and Z never fade
    radius: Real  # m; torsional radius of the pads
    effort_limit: Joints  # N m
    contact: Annotated[Records[Contact], MAX_CONTACTS]


NULLSPACE_RATE = 10.0
"""Rate of the null space for velocity and position drives, and for effort drives that could not follow [1/s]."""
YIELDS_M = 0.5
"""Distance from the reference over which the impedance fades [m]: larger than the distance over which a slowly braking
object pulls the arm, since the impedance at that distance would tear the pad off."""

LAW_CONFIG = dtype_of(LawConfig)


def make_law_config(params: ControllerParams, effort_limit: Array, inertia: Array) -> Array:
    """Return the LawConfig buffer of the parameters; effort_limit (n,) [N m], inertia of each joint (n,) [kg m2]."""
    buffer = new(LAW_CONFIG)
    config: LawConfig = record(buffer, LAW_CONFIG)
    config.joints = len(effort_limit)
    config.contacts = fill_contacts(params.contacts, config.contact)
    config.attitude = Coordinates[params.attitude.upper()].value
    config.nullspace_stiffness, config.nullspace_damping = params.nullspace.stiffness, params.nullspace.damping
    rate = FOLLOWED_BY_EFFORT / (params.drive_lag_s + params.control_period_s)
    most = 0.5 * rate * sum(sorted(inertia)[:2])  # N m s/rad; one joint alone would move the pad
    swings = params.nullspace.damping > most or params.nullspace.stiffness > 0.25 * rate * most
    if params.command.interface != "effort" or swings:
        config.nullspace_rate = min(params.fastest_rate, NULLSPACE_RATE)
    if params.bounded_authority:
        config.yields = YIELDS_M
    config.radius = params.governor.torsional_radius
    config.sigma_min, config.most_damping = params.singularity.sigma_min, params.singularity.damping
    config.effort_limit[: len(effort_limit)] = effort_limit
    return buffer
