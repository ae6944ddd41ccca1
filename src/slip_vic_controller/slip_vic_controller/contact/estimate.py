"""The contact estimate of a cycle: is it slipping, how fast, what can friction carry, and may the sensors be believed.

One record with one reader for each part: the law reads v_s; governor, guard and grip read F_lo and F_median; safety
reads slipping, age and health. Nothing else decides whether the object slips.
"""

from __future__ import annotations

from enum import IntEnum, unique
from typing import Final

from slip_core.compiled import part
from slip_core.records import Mat3, Real, Record, Vec6, Whole, dtype_of
from slip_core.vectors import Vec, mat
from slip_vic_controller.contact.friction_estimate import GIVES_M, Estimate, EstimateConfig, Friction

DIFFERS: Final = 0.7
"""Share of the way slipped by which another mounting must explain its direction better than the configured one: a
mistake is a difference of 1 or 2, noise of a sample at six standard deviations one of 0.03."""


@unique
class SensorHealth(IntEnum):
    """Whether a sensor may be believed; of the slip sensor also how it contradicts the friction force."""

    OK = 0
    SILENT = 1
    READS_NOTHING = 2
    X_INVERTED = 3
    Y_INVERTED = 4
    Z_INVERTED = 5
    INVERTED = 6
    XY_SWAPPED = 7
    YZ_SWAPPED = 8
    ZX_SWAPPED = 9


class ContactEstimate(Record):
    """What is known of a contact in a cycle; loads at the nominal grip."""

    v_s: Vec6  # m/s, rad/s {ee}; slip velocity that the law answers
    variance: Vec6  # of the estimated one; zeros without an observer
    slipping: Whole
    slip_ns: Whole  # stamp of the newest sample that shows it
    F_lo: Real  # N; what is certain to be carried
    F_median: Real  # N; F^
    slipped_at: Real  # N; smallest load at which it has slipped, 0 before
    carried: Real  # N; largest load carried without slip
    first: Real  # N; F^ at first
    age_ns: Whole  # of the newest slip sample
    slip_health: Whole  # SensorHealth
    wrench_health: Whole  # SensorHealth
    needs: Real  # N; where the slip sensor reads nothing: load that the motion needs
    lacks: Real  # N; and the one that the wrench shows


class Directions(Record):
    """How the measured slip lies to the friction force."""

    way: Mat3  # m {ee}; of slip, times the direction in which the pad drags the object: sum of v dt d^T
    length: Real  # m; of that way
    mounted: Whole  # SensorHealth that it shows


CONTACT_ESTIMATE, DIRECTIONS = dtype_of(ContactEstimate), dtype_of(Directions)


@part
def put_friction(config: EstimateConfig, friction: Estimate, out: ContactEstimate) -> None:
    """Write what is known of friction and slip."""
    out.F_median, out.slipped_at, out.first = friction.F_hat, friction.slipped_at, friction.first
    out.carried, out.slipping, out.slip_ns = friction.certified, friction.slipping, friction.slip_ns
    out.F_lo = min(out.carried, out.F_median) if config.friction == Friction.UNKNOWN else out.F_median


@part
def weaker(out: ContactEstimate, pad: ContactEstimate) -> None:
    """Let the estimate of all pads count with another pad where that one is weaker; each sensor sees its own pad."""
    if pad.F_median < out.F_median:
        out.F_median, out.slipped_at = pad.F_median, pad.slipped_at
    out.F_lo, out.carried, out.first = min(out.F_lo, pad.F_lo), min(out.carried, pad.carried), min(out.first, pad.first)
    out.slipping, out.slip_ns = max(out.slipping, pad.slipping), max(out.slip_ns, pad.slip_ns)


@part
def end_slip(config: EstimateConfig, out: ContactEstimate, now_ns: int) -> None:
    """End the slip of several pads when no sample of any has shown one for so long [ns]."""
    if out.slipping != 0 and now_ns - out.slip_ns >= config.quiet_ns + config.sensor_delay_ns:
        out.slipping = 0


@part
def take_weakest(config: EstimateConfig, friction: Estimate, pad: ContactEstimate, all_pads: ContactEstimate) -> None:
    """Let a pad know what all pads together have: friction of the weakest one, and whether any slips."""
    friction.F_hat, friction.slipped_at = all_pads.F_median, all_pads.slipped_at
    friction.slipping, friction.slip_ns = all_pads.slipping, all_pads.slip_ns
    put_friction(config, friction, pad)


@part
def compare_directions(state: Directions, v: Vec, drags: Vec, dt: float) -> int:
    """Take in a sample of a slip; return how the sensor is mounted where that is not as configured, else OK.

    Friction opposes slip, whatever its coefficient: the pad slides over the object in the direction in which it drags
    it. A mounting T explains sum |v| dt (T v^ . d^) of the way; the best one counts.

    Args:
        state: changed.
        v: slip velocity on the axes that can slip [m/s] {ee}.
        drags: force of the pad on the object on these axes [N] {ee}.
        dt: since the sample before [s].
    """
    force = drags.norm()
    if force == 0.0:
        return SensorHealth.OK.value
    d, step = (1.0 / force) * drags, dt * v
    for i in range(3):
        for j in range(3):
            state.way[i, j] += step[i] * d[j]
    state.length += step.norm()
    if state.length < GIVES_M:
        return SensorHealth.OK.value
    M = mat(state.way)
    x, y, z = M.x.x, M.y.y, M.z.z
    better = (
        -2.0 * x,
        -2.0 * y,
        -2.0 * z,
        -2.0 * (x + y + z),
        M.x.y + M.y.x - x - y,
        M.y.z + M.z.y - y - z,
        M.z.x + M.x.z - z - x,
    )
    found, most = SensorHealth.OK.value, DIFFERS * state.length
    for i in range(len(better)):
        if better[i] > most:
            found, most = SensorHealth.X_INVERTED.value + i, better[i]
    return int(found)


@part
def start_directions(state: Directions) -> None:
    """Begin: nothing has slipped."""
    state.way[:] = 0.0
    state.length, state.mounted = 0.0, SensorHealth.OK.value
