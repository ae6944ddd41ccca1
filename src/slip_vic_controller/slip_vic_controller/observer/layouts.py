"""Records of the slip observer: tuning, what a tick tells it, state between ticks, and the rows of its history.

Arrays over axes have six entries, linear x, y, z, then angular, on the pad's axes {ee} unless said otherwise; entries
of axes that are not filtered are zero. Stamps are whole nanoseconds.
"""

from __future__ import annotations

from slip_core.records import REAL, WHOLE, layout
from slip_vic_controller.observer.axis import AXIS

AXES = 6

OBSERVER_CONFIG = layout(
    axes=(WHOLE, AXES),
    measurement_variance=(REAL, AXES),
    process_variance=(REAL, AXES),
    drift_variance=(REAL, AXES),
    prior_P_bb=(REAL, AXES),
    prior_P_cc=(REAL, AXES),
    onset_gain=(REAL, AXES),
    floor_variance=(REAL, AXES),
    stick_P_bb=(REAL, AXES),
    stick_P_vv=(REAL, AXES),
    dead_band=(REAL, AXES),
    nis_slip=REAL,
    nis_stick=REAL,
    smoothing=REAL,
    most_step=REAL,
    outlier_deviations=REAL,
    friction_spread=REAL,
    friction_memory_ticks=REAL,
    dwell_ticks=WHOLE,
    window_ticks=WHOLE,
    memory_ns=WHOLE,
)
"""Tuning; speeds and accelerations in m/s, m/s^2 on linear and rad/s, rad/s^2 on angular axes.

axes: 1 where the axis is filtered. measurement_variance: R of a slip sample. process_variance: Q of v per tick, from
wrench noise and model. drift_variance: Q of b per tick. prior_P_bb, prior_P_cc: what is known of the model's errors at
the beginning. onset_gain: standard deviation that b gains when slip begins, per acceleration of the object [1, 1/m].
floor_variance: of a slip velocity that means nothing. stick_P_bb, stick_P_vv: variances above which nothing is taken
for stick. dead_band: speed below which the sensor reads zero. nis_slip, nis_stick: normalised innovation squared above
which slip begins, and below which it is over. smoothing: weight of a new sample in the mean that is tested in stick;
most_step: how far one sample may move that mean, over what is significant [1]. outlier_deviations: beyond which a
sample pulls no harder. friction_spread: how far friction may point away from the slip [rad], 0 = its direction is not
used; friction_memory_ticks: over which that error stays the same. dwell_ticks:
below nis_stick until slip is over. window_ticks: over which slip must show in the model. memory_ns: how late a sample
may be.
"""

MOTION = layout(
    rotation=(REAL, (3, 3)),
    v_ee=(REAL, 6),
    follow=(REAL, 6),
    force=(REAL, 6),
    drag=(REAL, 3),
    w_o=(REAL, 3),
)
"""What a tick tells the observer; {w}.

rotation: R_ee. v_ee: twist of the pad [m/s, rad/s]. follow: G^T a_o + Phi2 from the wrench, the acceleration of the
object's material point under the pad [m/s^2, rad/s^2]. force: the part of it that the wrench gives, without gravity.
drag: acceleration that the pad gives to the centre of mass [m/s^2]. w_o: angular velocity of the object [rad/s].
"""

SLIP_SAMPLE = layout(stamp_ns=WHOLE, twist=(REAL, 6))
"""A slip sample: when it was measured, and the slip twist [m/s, rad/s] {ee}."""

OBSERVER = layout(
    stamp_ns=WHOLE,
    sliding=WHOLE,
    since_ns=WHOLE,
    quiet=WHOLE,
    late=WHOLE,
    first=WHOLE,
    rows=WHOLE,
    twist=(REAL, 6),
    error=(REAL, 6),
    variance=(REAL, 6),
    significance=REAL,
    v_ee=(REAL, 6),
    sample_mean=(REAL, AXES),
    axes=(AXIS, AXES),
)
"""State between ticks.

stamp_ns: of the last tick. sliding: 0 stick, 1 slip. since_ns: when stick began. quiet: ticks in a row without
significant slip. late: number of samples that came too late to be used. first, rows: where the history begins in its
ring, and its length. What the law is given, on {ee}: twist, the slip velocity, zero in stick; error, b + c f of
`follow`; variance of the slip velocity; significance, the normalised innovation squared. v_ee: of the last tick {w}.
sample_mean: of the samples that were measured in stick, weighted. axes: the filters.
"""

TICK_ROW, SAMPLE_ROW = 0, 1

ROW = layout(
    stamp_ns=WHOLE,
    kind=WHOLE,
    sample=SLIP_SAMPLE,
    contradicts=WHOLE,
    dt=REAL,
    turn_linear=(REAL, 3),
    turn_angular=(REAL, 3),
    drag=(REAL, 3),
    step=(REAL, AXES),
    force=(REAL, AXES),
    time=REAL,
    steps=(REAL, AXES),
    impulses=(REAL, AXES),
    axes=(AXIS, AXES),
)
"""A row of the history: a tick, or a sample behind the tick at which it counts.

stamp_ns: of the tick; kind: TICK_ROW or SAMPLE_ROW; sample: of a SAMPLE_ROW, and whether it contradicts the estimate
before it. Of a tick: dt since the tick before [s];
turn_linear, turn_angular: w_ee + 2 w_o, w_ee + w_o [rad/s]; drag [m/s^2]; step: change of the slip velocity as the
uncorrected model has it; force: specific force. In stick: time, steps, impulses: dt, step and dt force added up since
its beginning. In slip: axes, the estimate with this row taken in.
"""

ROW_SIZE = ROW.itemsize // 8
"""Numbers of a row."""
