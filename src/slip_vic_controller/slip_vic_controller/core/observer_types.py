"""What the slip observer is told, what it remembers and what it gives, in its plain form."""

from __future__ import annotations

from typing import NamedTuple

from slip_core.arrays import Array
from slip_vic_controller.core.slip_filter_kernel import AxisFilter

Floats = tuple[float, ...]


class ObserverConfig(NamedTuple):
    """Tuning of the observer; tuples are per filtered axis.

    axes: indices of the filtered axes, of 6; noise: variance of a sensor sample; force_noise: variance of v per tick
    from wrench noise and model; floor: variance below which a slip velocity means nothing; rest: variance of b above
    which nothing is taken for rest; prior_b, prior_c: variances of the model's errors; drift_b: variance that b gains
    per tick; onset_b: deviation that b gains when slip begins, per acceleration of the object [1, 1/m];
    calm: variance of v above which nothing is taken for rest;
    dead_band: linear, angular; chi_on, chi_off: thresholds on the significance; dwell: ticks below chi_off until stick;
    memory_ns: how late a sample may be; smoothing: weight of a new sample in the mean that is tested; window: ticks
    over which slip must show in the model; outlier: deviations.
    """

    axes: tuple[int, ...]
    noise: Floats
    force_noise: Floats
    floor: Floats
    rest: Floats
    prior_b: Floats
    prior_c: Floats
    drift_b: Floats
    onset_b: Floats
    calm: Floats
    dead_band: tuple[float, float]
    chi_on: float
    chi_off: float
    dwell: int
    memory_ns: int
    smoothing: float
    window: int
    outlier: float
    drag_spread: float
    drag_memory: float


class Sample(NamedTuple):
    """A sensor sample on the filtered axes."""

    stamp_ns: int
    values: Floats


class Moment(NamedTuple):
    """One tick: what it did to the slip velocity, the samples measured at it, and in slip the estimate with them.

    time, steps, impulses: dt, step and dt force added up since the last change between stick and slip.
    """

    stamp_ns: int
    dt: float
    time: float
    steps: Floats
    impulses: Floats
    step: Floats
    turn_linear: Floats
    turn_angular: Floats
    force: Floats
    drag: Floats
    samples: tuple[Sample, ...]
    estimate: tuple[AxisFilter, ...]


class ObserverState(NamedTuple):
    """What the observer remembers. twist (6,) {w}: of {ee} at the last tick; mean: of the samples that were
    measured in stick, after since_ns, weighted;

    quiet: ticks in a row without significant slip; late: samples that came too late to be used.
    """

    stamp_ns: int
    sliding: bool
    estimate: tuple[AxisFilter, ...]
    twist: Array
    mean: Floats
    since_ns: int
    quiet: int
    history: tuple[Moment, ...]
    late: int


class Motion(NamedTuple):
    """What a tick tells the observer; (6,) unless said otherwise.

    stamp_ns; R_ee (3, 3); v_ee {w}; follow: G^T a_o + Phi2 from the wrench [m/s^2, rad/s^2] {w}; force: the part of it
    that the wrench gives, without gravity {w};
    drag (3,): acceleration that the pad gives to the centre of mass [m/s^2] {w}; w_o (3,) [rad/s] {w}.
    """

    stamp_ns: int
    R_ee: Array
    v_ee: Array
    follow: Array
    force: Array
    drag: Array
    w_o: Array


class SlipEstimate(NamedTuple):
    """twist (6,): significant slip velocity, zero in stick; error (6,): of `follow`; variance (6,): of twist; on {ee}.

    significance: v^T P^-1 v, to be compared with chi_on; sliding: which hypothesis holds.
    """

    twist: Array
    error: Array
    variance: Array
    significance: float
    sliding: bool
