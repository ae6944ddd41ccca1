"""Records of the joint state estimator: its configuration, its estimate, and what it finds wrong with a joint."""

from __future__ import annotations

from enum import IntEnum, unique
from typing import Annotated, Final

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Whole, dtype_of
from slip_vic_controller.safety.conditions import NOTHING, Reason, Why, WhyRecord, put_why
from slip_vic_controller.sizes import MAX_JOINTS, Joints, WholeJoints

MAX_LATENCY: Final = 32
"""Control periods by which the joint sensor may be late."""
LONGEST_STEP: Final = 20
"""Control periods after which a sample begins the estimate again: what the arm did is not known."""
RING: Final = MAX_LATENCY + LONGEST_STEP + 1
"""Inputs that are kept: of so many control periods."""


@unique
class Trust(IntEnum):
    """Which measurement of a joint is used."""

    BOTH = 0
    POSITION = 1
    VELOCITY = 2
    NEITHER = 3  # the model alone


BothWays = Annotated[Array, (2, MAX_JOINTS)]
QUICK: Final = len(Trust)
"""Row of the gains for both measurements while innovations show that the disturbance changes fast, after those by
Trust."""


class JointRecord(Record):
    """A joint state."""

    stamp_ns: Whole
    position: Joints  # rad
    velocity: Joints  # rad/s
    effort: Joints  # N m


class EstimatorConfig(Record):
    """What does not change while the controller runs."""

    on: Whole  # 0: samples are used as they are, until one contradicts another
    joints: Whole
    period: Real  # s; of control
    bandwidth: Real  # rad/s; of velocity drives, 0 = efforts
    late_ticks: Whole  # latency of the sensor, whole control periods
    drive_ticks: Whole  # control periods from an input to its effect
    sensor_ticks: Whole  # control periods for which the sensor repeats a sample; 1 = each is new
    sensor_period: Real  # s; between new samples
    gain: Annotated[Array, (5, 3, 2)]  # of (q, v, d) for innovations of position and velocity; by Trust, and QUICK
    quick_ticks: Whole  # control periods for which QUICK is used after the innovations have said so
    scale: Annotated[Array, 2]  # 1/rad, s/rad; over the standard deviation of an innovation
    weight: Real  # of a new innovation in their mean
    gate: Real  # square of the mean of scaled innovations that is no noise
    velocity_variance: Real  # (rad/s)^2; of the predicted velocity
    change_variance: Real  # (rad/s)^2; noise of its change over a period
    difference: Real  # rad; sum of the parity that is no noise
    late: Real  # s; by which velocities may be behind positions
    unmoved: (
        Real  # rad; way by its velocity after which a joint that is measured does not read the same to the last bit
    )
    bound: Joints  # N m; most of the disturbance that is taken off the effort
    rate: Joints  # N m/s; of what is taken off
    settling: Real  # s; time constant with which it follows the estimate
    collision: Joints  # N m; jump of the disturbance that is a collision
    friction: Joints  # N m; of the joints, as configured: it changes its sign with the velocity


class JointEstimate(Record):
    """The estimate, and what it needs of the past."""

    started: Whole
    stamp_ns: Whole  # of the last sample
    renewed_ns: Whole  # of the last one that was new
    since: Whole  # control periods since one corrected the estimate
    q: Joints  # rad; when the last sample was measured
    v: Joints  # rad/s
    d: Joints  # rad/s^2; disturbance
    position: Joints  # rad; now
    velocity: Joints  # rad/s; now
    newest: Whole  # place of the last input in its ring
    inputs: Annotated[Array, (RING, MAX_JOINTS)]  # rad/s^2 or rad/s; one per control period
    remembered: Whole  # inputs since the last sample
    measured_position: Joints  # rad; of the last sample
    measured_velocity: Joints  # rad/s
    mean_q: Joints  # mean of scaled innovations of position
    mean_v: Joints  # and of velocity
    quick: WholeJoints  # control periods for which the gains QUICK are used still
    parity: BothWays  # rad; sum of what position shows beyond velocity, and of the opposite
    moved: BothWays  # rad; way of the position since the sum was zero
    swept: BothWays  # rad; way of the velocity
    began: BothWays  # rad/s; the velocity then
    same_position: WholeJoints  # samples in a row that are equal to the last bit
    same_velocity: WholeJoints
    reversals: WholeJoints  # of the velocity from sample to sample, since a sample after one that repeated another
    unmeasured: WholeJoints  # control periods for which it has read the same, though it moves or never did before
    trust: WholeJoints  # Trust
    alone: Whole  # whether positions alone are measured
    effort: Joints  # N m; disturbance
    slow_effort: Joints  # N m; its low-pass
    slow_wrench: Joints  # N m; low-pass of the measured wrench's torque
    wrench_jump: Joints  # N m; how far that has been off its low-pass, faded
    taken_off: Joints  # N m; added to the effort against it
    jumped_s: Joints  # s; for how long the disturbance has been off its low-pass
    beyond_s: Joints  # s; for how long it has been beyond its bound
    found: WhyRecord  # what is wrong with a joint, the first thing; kept until `clear_findings`


ESTIMATOR_CONFIG, JOINT_ESTIMATE = dtype_of(EstimatorConfig), dtype_of(JointEstimate)
JOINT_SAMPLE = dtype_of(JointRecord)


@part
def clear_findings(state: JointEstimate) -> None:
    """Forget what was wrong: both measurements of every joint are used again, from the next sample on."""
    if state.trust.any():
        state.started = 0
    put_why(state.found, NOTHING)
    state.trust[:] = 0
    state.parity[:] = 0.0
    state.jumped_s[:] = 0.0
    state.beyond_s[:] = 0.0


@part
def find(state: JointEstimate, reason: int, j: int, value: float, limit: float) -> None:
    """Note what is wrong with joint j; the first finding stays."""
    if state.found.reason == Reason.NONE:
        put_why(state.found, Why(0 + reason, 0, 0, j, value, limit))
