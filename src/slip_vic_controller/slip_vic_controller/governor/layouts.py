"""Records of the governor: configuration, state on the path, and state of each pad."""

from __future__ import annotations

from typing import Annotated, Final

from slip_core.arrays import Array
from slip_core.records import Real, Record, Vec3, Vec6, Whole, dtype_of
from slip_vic_controller.contact.belief import Belief
from slip_vic_controller.contact.estimate import ContactEstimate
from slip_vic_controller.contact.friction_estimate import FrictionConfig, FrictionEvidence
from slip_vic_controller.contact.slip_health import SlipEvidence
from slip_vic_controller.contact.wrench_evidence import WrenchEvidence
from slip_vic_controller.sizes import ROOM

PATH_MARGIN: Final = 0.97
"""Share of a load in the backward pass."""
GIVEN_UP: Final = 0.985
"""Share of the load at slip that may be used if nothing less stops on the path."""
LENGTH, FLOOR = 0.1, 0.05
"""Time-optimal: L, the length that converts rotation to a path length [m], and the speed where the path reverses
[m/s]."""


class GovernorConfig(Record):
    """Configuration of the governor."""

    mode: Whole  # Governing
    margin: Real  # beta, share of F^ that a motion may use
    reserve: Real  # share of the friction beside the weight that the path does not use
    radius: Real  # m, rho
    slip_axes: Vec6  # Sigma, 0 or 1, {ee}
    weights: Vec6  # S^-1 Sigma; 1, 1/m
    bias: Real  # N, load that the wrench's expected error looks like
    gravity: Vec3  # m/s^2 {w}
    duration: Real  # s, of the user's path
    most_grip: Real  # largest grip over the configured one
    most_speed: Real  # m/s, of the pad
    most_turning: Real  # rad/s
    preview_s: Real  # s, how much later a stream is followed
    window: Whole  # cycles of the moving average
    disturbed: Whole  # whether drives add to commanded efforts: they have errors, and no loop of their own
    led: Whole  # whether an object that slips leads the path; several arms keep to it
    friction: FrictionConfig


class Governor(Record):
    """Position on the path, the current plan, and what limits the path."""

    duration: Real  # s, of the path that is followed
    s: Real
    rate: Real  # sdot
    time: Real  # s, the user's time at s
    end: Real  # of s
    out_s: Real  # the same after smoothing
    out_rate: Real
    out_u: Real  # sddot
    out_time: Real  # s
    out_speed: Real  # ds/dt of the first pad's path at out_time
    out_bend: Real  # its rate
    planned: Whole  # whether there is a plan
    asked: Real  # N, that a plan was asked for
    plan_load: Real  # N, of the plan in use: more than that where margin was given up to stop on the path
    infeasible: Whole  # friction does not carry the weight everywhere on the path
    heaviest_time: Real  # s, where the weight loads most
    weight_load: Real  # N, that load
    limit: Whole  # Limit: the first that leaves no sddot
    overrun: Whole  # no allowed load stops on the path
    led_s: Real  # s, for which a slipping object has led the path while it hardly moved
    endless: Whole  # that slip does not end, so the path continues
    arrived: Whole
    usable: Real  # N, load that the path may use
    ceiling: Real  # N, load that the guard lets pass
    ring_count: Whole
    ring: Annotated[Array, (ROOM, 3)]  # s, sdot, sddot
    contact: ContactEstimate  # of the weakest pad


class GovernedPad(Record):
    """State of the governor for each pad."""

    feedback: Vec6  # a_C - a_d of the last cycle {w}
    drawn: Vec6  # N on pad axes, load of the command of the last cycle
    commanded: Real  # N, its size
    measured: Real  # N
    guard: Real  # factor on a_C
    grip: Real  # over the one for which F^ is configured
    friction: FrictionEvidence
    evidence: WrenchEvidence
    belief: Belief
    sensor: SlipEvidence
    contact: ContactEstimate


GOVERNOR_CONFIG, GOVERNOR, PAD = dtype_of(GovernorConfig), dtype_of(Governor), dtype_of(GovernedPad)
