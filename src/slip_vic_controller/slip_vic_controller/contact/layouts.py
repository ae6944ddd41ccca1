"""Records of the slip observer: tuning, what a tick brings, state between ticks, and the rows of its history.

Arrays over axes have six entries, linear x, y, z, then angular, on the pad's axes {ee} unless said otherwise; entries
of axes that are not filtered are zero. Stamps are whole nanoseconds.
"""

from __future__ import annotations

from typing import Annotated

from slip_core.records import Mat3, Real, Record, Records, Vec3, Vec6, Whole, dtype_of
from slip_vic_controller.contact.axis import Axis

WITNESSES = 3
"""Samples in a row that a real sensor must show: two outliers in a row occur every minute."""


class ObserverConfig(Record):
    """Tuning; speeds and accelerations in m/s, m/s^2 on linear and rad/s, rad/s^2 on angular axes."""

    axes: Vec6  # 1 where the axis is filtered
    measurement_variance: Vec6  # R of a slip sample
    information: Vec6  # 1 / R on the axes that are filtered, 0 on the others
    process_variance: Vec6  # Q of v per tick, from wrench noise and model
    drift_variance: Vec6  # Q of b per tick
    prior_P_bb: Vec6  # noqa: N815 - what is known of the model's errors at the beginning
    prior_P_cc: Vec6  # noqa: N815
    onset_gain: Vec6  # 1, 1/m; standard deviation that b gains when slip begins, per acceleration of the object
    floor_variance: Vec6  # of a slip velocity that means nothing
    stick_P_bb: Vec6  # noqa: N815 - variances above which nothing is taken for stick
    stick_P_vv: Vec6  # noqa: N815
    dead_band: Vec6  # speed below which the sensor reads zero
    nis_slip: Real  # normalised innovation squared above which slip begins
    nis_stick: Real  # and below which it is over
    smoothing: Real  # weight of a new sample in the mean that is tested in stick
    mean_share: Real  # variance of that mean over R
    most_step: Real  # how far one sample may move that mean, over what is significant
    outlier_deviations: Real  # beyond which a sample pulls no harder
    friction_spread: Real  # rad; how far friction may point away from the slip, 0 = its direction is not used
    friction_memory_ticks: Real  # over which that error stays the same
    dwell_ticks: Whole  # below nis_stick until slip is over
    window_ticks: Whole  # over which slip must show in the model
    memory_ns: Whole  # how late a sample may be


OBSERVER_CONFIG = dtype_of(ObserverConfig)


class Motion(Record):
    """What a tick brings to the observer; {w}."""

    rotation: Mat3  # R_ee
    v_ee: Vec6  # m/s, rad/s; twist of the pad
    follow: Vec6  # m/s^2, rad/s^2; G^T a_o + Phi2: acceleration of the object's material point under the pad
    force: Vec6  # m/s^2, rad/s^2; the part of it that the wrench gives, without gravity
    drag: Vec3  # m/s^2; acceleration that the pad gives to the centre of mass
    w_o: Vec3  # rad/s; turning of the object
    velocity_variance: Vec6  # {ee}; of v_ee, zeros without an estimate of the joint state
    change_variance: Vec6  # {ee}; of the noise in the change of v_ee since the tick before


MOTION = dtype_of(Motion)


class Observer(Record):
    """State between ticks; what the law is given is on {ee}."""

    stamp_ns: Whole  # of the last tick
    sliding: Whole  # 0 stick, 1 slip
    since_ns: Whole  # when stick began
    quiet: Whole  # ticks in a row without significant slip
    late: Whole  # number of samples that came too late to be used
    first: Whole  # where the history begins in its ring
    rows: Whole  # and its length
    twist: Vec6  # m/s, rad/s {ee}; slip velocity, zero in stick
    error: Vec6  # m/s^2, rad/s^2 {ee}; b + c f of `follow`
    variance: Vec6  # of the slip velocity
    significance: Real  # normalised innovation squared
    v_ee: Vec6  # m/s, rad/s {w}; twist of the pad at the last tick
    sample_mean: Vec6  # of the samples that were measured in stick, weighted
    axes: Annotated[Records[Axis], 6]  # the filters


OBSERVER = dtype_of(Observer)


class Row(Record):
    """A row of the history: a tick, and the samples that count at it."""

    stamp_ns: Whole
    samples: Whole  # how many
    reads: Vec6  # their sum
    contradicts: Whole  # whether their mean contradicts the estimate before it
    dt: Real  # s; since the tick before
    turn_linear: Vec3  # rad/s; w_ee + 2 w_o
    turn_angular: Vec3  # rad/s; w_ee + w_o
    drag: Vec3  # m/s^2
    step: Vec6  # change of the slip velocity as the uncorrected model has it
    force: Vec6  # specific force
    velocity_variance: Vec6  # of the pad's velocity
    change_variance: Vec6  # of the noise in `step`
    axes: Annotated[Records[Axis], 6]  # in slip: the estimate with this row taken in


ROW = dtype_of(Row)

ROW_SIZE = ROW.itemsize // 8
"""Numbers of a row."""
