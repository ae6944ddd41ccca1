"""Friction of the contact: configured, learnt from slips, or probed.

Only loads are used, no friction law. A slip sample arrives late, so a short history of loads is kept, and the load at
the sample's stamp counts.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Annotated, Final

from slip_core.compiled import part
from slip_core.records import Real, Record, Records, Vec6, Whole
from slip_core.vectors import Spatial, put_spatial, spatial
from slip_vic_controller.contact.estimate import ContactEstimate
from slip_vic_controller.sizes import NEVER

LOADS: Final = 256
"""Control cycles that the history goes back."""
LEAST_FRICTION: Final = 0.35
"""Share of the known friction below which missing load counts less: 0.6 of what is configured, that falls to 0.7 while
it is carried, and slides with less."""
PLAUSIBLE: Final = 0.5
"""Share of the known friction below which a slip is doubted: it may be a model error, or shear of the pads."""
GIVES_M: Final = 1e-3
"""Largest shear of soft pads [m]: a slip at a load far below what they have carried counts only beyond it."""
OBSERVED: Final = 0.5
"""Share of the threshold that a slip sample must show where the observer has found slip: two pieces of evidence."""
KEPT: Final = 0.95
"""Share of the load at which it slipped that it carries."""
QUIET_NS: Final = 50_000_000
"""Time without slip after which the contact counts as sticking."""
FASTEST_GROWTH: Final = 30.0
"""Largest acceleration of slip: a few times gravity [m/s^2]."""


@unique
class Friction(IntEnum):
    """Where the friction limit comes from."""

    KNOWN = 0
    LEARNT = 1
    UNKNOWN = 2


class Load(Record):
    """The load at a stamp."""

    stamp_ns: Whole
    measured: Real  # N, |S^-1 Sigma h_ee|
    commanded: Real  # N, |l(a_C)| of the command that led to it, which is that of the cycle before


class FrictionConfig(Record):
    """How friction is estimated."""

    friction: Whole  # Friction
    configured: Real  # N, mu N as configured, or the most that is ever probed
    least: Real  # N, floor of F^
    probe: Real  # N, eps: load beyond the certified one
    pre_sliding: Real  # m, way that pads give before they slip
    threshold: Real  # m/s, slip speed |S v_s| that counts
    least_threshold: Real  # m/s, of a sensor without noise
    quantum: Real  # m/s, step of the readings; inf of a flag
    slip_count: Whole  # samples in a row that must show it
    confirmed: Whole  # the same where the observer finds slip too
    sensor_delay_ns: Whole  # age at which a cycle's load is known to have been carried
    noise_ns: Whole  # loads so long before and after a stamp are averaged


class FrictionEvidence(Record):
    """Evidence of friction: loads of the last cycles, and the slip samples."""

    count: Whole  # cycles that have been remembered
    loads: Annotated[Records[Load], LOADS]
    events: Whole  # how often F^ was made smaller
    said: Whole  # samples in a row that show slip
    said_ns: Whole  # stamp of the first of them
    last_ns: Whole  # and of the newest sample that is no outlier
    way: Vec6  # m, that they have slipped; turning at the torsional radius
    suspected_at: Real  # N, load at which the observer began to find a slip; 0 = it finds none, inf = samples decide
    suspected_ns: Whole  # stamp of that load


@part
def start_friction(
    config: FrictionConfig, contact: ContactEstimate, state: FrictionEvidence, at_rest: float, rests_with: float
) -> None:
    """Start with the configured friction, or with more if the object at rest proves more.

    An object at rest is carried: if its weight, found by a tare, exceeds the configured friction, friction is larger.
    Its load counts like that of a slip: 1/0.95 of it is carried.

    Args:
        config, contact, state: how friction is estimated, and what is written.
        at_rest: load at rest [N].
        rests_with: load at rest that a tare has found [N]; 0 where it is the configuration's.
    """
    disproved = config.friction == Friction.LEARNT and rests_with > config.configured
    contact.first = rests_with / KEPT if disproved else config.configured
    contact.F_median, contact.slipped_at = contact.first, 0.0
    contact.carried = min(at_rest + config.probe, contact.first)
    contact.slipping, contact.slip_ns = 0, NEVER
    state.count, state.events, state.said, state.said_ns, state.last_ns, state.way[:] = 0, 0, 0, NEVER, NEVER, 0.0
    state.suspected_at, state.suspected_ns = 0.0, 0
    put_certain(config, contact)


@part
def put_certain(config: FrictionConfig, contact: ContactEstimate) -> None:
    """Write the load that is certainly carried: with unknown friction no more than has been."""
    unknown = config.friction == Friction.UNKNOWN
    contact.F_lo = min(contact.carried, contact.F_median) if unknown else contact.F_median


@part
def remember(state: FrictionEvidence, stamp_ns: int, measured: float, commanded: float) -> None:
    """Add the load measured at a stamp, and what the cycle before had commanded [N]."""
    place = state.loads[state.count % LOADS]
    place.stamp_ns, place.measured, place.commanded = stamp_ns, measured, commanded
    state.count += 1


@part
def index_at(state: FrictionEvidence, stamp_ns: int) -> int:
    """Return the place of the newest load that is not younger than a stamp, else of the oldest."""
    newest, oldest = state.count - 1, max(state.count - LOADS, 0)
    while newest > oldest and state.loads[newest % LOADS].stamp_ns > stamp_ns:
        newest -= 1
    return int(newest % LOADS)


@part
def certify(config: FrictionConfig, contact: ContactEstimate, state: FrictionEvidence, now_ns: int) -> None:
    """Count the load of a cycle as carried once the slip sensor would have shown a slip."""
    i = index_at(state, now_ns - config.sensor_delay_ns)
    if contact.slipping == 0 and state.loads[i].stamp_ns <= now_ns - config.sensor_delay_ns:
        contact.carried = min(max(contact.carried, state.loads[i].commanded), contact.F_median)


@part
def slipping_load(config: FrictionConfig, state: FrictionEvidence, i: int) -> float:
    """Return the load [N] that counts where the contact slipped at the stamp of place i.

    The measured one is a mean: with single wrenches, the minimum would learn their noise at every slip.
    """
    load, total, count = state.loads[i], 0.0, 0
    for k in range(min(state.count, LOADS)):
        other = state.loads[k]
        if abs(other.stamp_ns - load.stamp_ns) <= config.noise_ns:
            total, count = total + other.measured, count + 1
    return float(min(total / count, load.commanded))


@part
def may_be_shear(
    config: FrictionConfig, contact: ContactEstimate, state: FrictionEvidence, stamp_ns: int, step: Spatial
) -> bool:
    """Return whether a slip may be shear of the pads: back and forth, not far from where it began.

    Soft pads shear with the rate of the load, whatever its size, and friction does not fail far below a load that it
    has carried. step: since the last sample [m].
    """
    way = spatial(state.way) + step
    put_spatial(state.way, way)
    length, load = math.sqrt(way.dot(way)), slipping_load(config, state, index_at(state, stamp_ns))
    return length < max(config.pre_sliding, GIVES_M if load < PLAUSIBLE * contact.carried else 0.0)


@part
def slip_threshold(config: FrictionConfig, found: bool) -> float:
    """Return the speed [m/s] from which a sample shows slip; found: whether the observer finds it too."""
    return (OBSERVED if found else 1.0) * config.threshold


@part
def slip_sample(
    config: FrictionConfig, contact: ContactEstimate, state: FrictionEvidence, stamp_ns: int, slip: Spatial, found: bool
) -> None:
    """Update with a slip sample: whether the contact slips, and friction at the start of a slip.

    A single sample may be an outlier: a slip needs several in a row, or fewer if the observer confirms. A sample faster
    than slip can have become since the last one is an outlier and is ignored, unless it lasts or the sensor is perfect.
    Only the first sample of a slip shows where friction ended: later loads are sliding friction and the law's response.

    Args:
        config, contact, state: how friction is estimated; its estimate, changed.
        stamp_ns: when the sample was measured.
        slip: S v_s, turning at the torsional radius [m/s]; of a flag: infinite or 0.
        found: whether the observer finds slip.

    Implements: ours: F^ <- min(F^, 0.95 min(|S^-1 h_ee|, |l(a_C)|)) at the stamp of the first slip sample.
    """
    speed, slips = math.sqrt(slip.dot(slip)), contact.slipping != 0
    if not speed > slip_threshold(config, found):
        state.said, state.way[:], state.last_ns = 0, 0.0, stamp_ns
        if state.suspected_at > 0.0 and stamp_ns > state.suspected_ns:
            state.suspected_at = math.inf
        if slips and stamp_ns - contact.slip_ns >= QUIET_NS:
            contact.slipping = 0
        return
    known = NEVER < state.last_ns <= stamp_ns
    passed_s = 1e-9 * (stamp_ns - state.last_ns) if known else 0.0
    too_fast = known and config.slip_count > 1 and speed > config.threshold + FASTEST_GROWTH * passed_s
    if too_fast and (slips or state.said == 0):
        return
    stays = not slips and may_be_shear(config, contact, state, stamp_ns, passed_s * slip)
    state.last_ns = stamp_ns
    if stays:
        return
    if state.said == 0:
        state.said_ns = stamp_ns
    state.said += 1
    if not slips and state.said < (config.confirmed if found else config.slip_count):
        return
    contact.slipping, contact.slip_ns = 1, max(stamp_ns, contact.slip_ns)
    if not slips:
        learn_carried(config, contact, state, slipping_load(config, state, index_at(state, state.said_ns)))


@part
def suspect(config: FrictionConfig, contact: ContactEstimate, state: FrictionEvidence, found: bool) -> None:
    """Bound the certain load by that at which the observer finds a slip, until a slip sample confirms or denies it.

    Samples arrive late. Nothing is learnt from the observer alone: the bound ends when it no longer finds slip.
    """
    if not found:
        state.suspected_at = 0.0
    elif contact.slipping != 0:
        state.suspected_at = math.inf
    elif state.suspected_at == 0.0:
        newest = (state.count - 1) % LOADS
        load, state.suspected_ns = slipping_load(config, state, newest), state.loads[newest].stamp_ns
        state.suspected_at = load if load > LEAST_FRICTION * contact.F_median else math.inf
    if state.suspected_at > 0.0:
        contact.F_lo = min(contact.F_lo, KEPT * state.suspected_at)


@part
def learn_carried(config: FrictionConfig, contact: ContactEstimate, state: FrictionEvidence, carried: float) -> None:
    """Learn from the load [N at the nominal grip] that remained during a slip.

    It is what friction carries while sliding, and never raises the estimate; no slip sensor is needed.
    """
    learnt = max(KEPT * carried, config.least)
    if config.friction != Friction.KNOWN and learnt < contact.F_median:
        contact.F_median, contact.slipped_at = learnt, carried
        contact.carried = min(contact.carried, learnt)
        state.events += 1


# -- several pads


@part
def take_weaker(out: ContactEstimate, pad: ContactEstimate) -> None:
    """Lower the common estimate of all pads to that of another pad if that one is weaker."""
    if pad.F_median < out.F_median:
        out.F_median, out.slipped_at = pad.F_median, pad.slipped_at
    out.F_lo = min(out.F_lo, pad.F_lo)
    out.carried, out.first = min(out.carried, pad.carried), min(out.first, pad.first)
    out.slipping = max(out.slipping, pad.slipping)
