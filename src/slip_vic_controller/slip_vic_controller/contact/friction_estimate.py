"""What friction the contact has: configured, learnt from where it slipped, or probed.

Nothing but loads is used, no friction law. A slip sample comes late and tells of its own stamp, so a short history of
loads is kept, and the load at that stamp counts.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Annotated, Final

from slip_core.compiled import part
from slip_core.records import Real, Record, Records, Vec6, Whole, dtype_of
from slip_core.vectors import Spatial, put_spatial, spatial
from slip_vic_controller.contact.estimate import ContactEstimate
from slip_vic_controller.sizes import NEVER

LOADS: Final = 256
"""Control cycles that the history goes back."""
LEAST_FRICTION: Final = 0.35
"""Share of what is known of friction below which a load that is missing counts less: 0.6 of what is configured, that
falls to 0.7 while it is carried, and slides with less."""
PLAUSIBLE: Final = 0.5
"""Share of what is known of friction below which a slip is doubted: the model's error, or pads that give way."""
GIVES_M: Final = 1e-3
"""Most that soft pads give way [m]: how far a slip must go at a load far below what they have carried."""
OBSERVED: Final = 0.5
"""Share of the threshold that a slip sample must show where the observer has found slip: two pieces of evidence."""
FASTEST_GROWTH: Final = 30.0
"""Most that a slip gains speed: a few times gravity [m/s^2]."""


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
    kept: Real  # share of the load at which it slipped
    least: Real  # N, floor of F^
    probe: Real  # N, eps: load beyond the certified one
    pre_sliding: Real  # m, way that pads give before they slip
    threshold: Real  # m/s, slip speed |S v_s| that counts
    quantum: Real  # m/s, step of the readings; inf of a flag
    witnesses: Whole  # samples in a row that must show it
    confirmed: Whole  # the same where the observer finds slip too
    quiet_ns: Whole  # without slip for so long, it holds again
    sensor_delay_ns: Whole  # age at which a cycle's load is known to have been carried
    trust: Real  # least that the model's load may be of the measured one; below it the model is not used
    noise_ns: Whole  # loads so long before and after a stamp are averaged


class FrictionEvidence(Record):
    """What friction is learnt from: loads of the last cycles, and what the slip samples have said."""

    count: Whole  # cycles that have been remembered
    loads: Annotated[Records[Load], LOADS]
    most_carried: Real  # N, largest load carried without slip, whatever slips have shown since
    events: Whole  # how often F^ was made smaller
    said: Whole  # samples in a row that show slip
    said_ns: Whole  # stamp of the first of them
    last_ns: Whole  # and of the newest sample that is no outlier
    way: Vec6  # m, that they have slipped; turning at the torsional radius
    suspected_at: Real  # N, load at which the observer began to find a slip; 0 = it finds none, inf = it is known


FRICTION_CONFIG, FRICTION_EVIDENCE = dtype_of(FrictionConfig), dtype_of(FrictionEvidence)


@part
def start_friction(
    config: FrictionConfig, contact: ContactEstimate, state: FrictionEvidence, at_rest: float, rests_with: float
) -> None:
    """Begin with the friction that is configured, or with what the object at rest disproves that with.

    What rests is carried: an object that was weighed and loads the grasp by more than friction as configured is held by
    more. Its load counts as that of a slip would: 1/0.95 of it is carried.

    Args:
        config, contact, state: how friction is estimated, and what is written.
        at_rest: load at rest [N].
        rests_with: load at rest that a tare has found [N]; 0 where it is the configuration's.
    """
    disproved = config.friction == Friction.LEARNT and rests_with > config.configured
    contact.first = rests_with / config.kept if disproved else config.configured
    contact.F_median, contact.slipped_at = contact.first, 0.0
    contact.carried = state.most_carried = min(at_rest + config.probe, contact.first)
    contact.slipping, contact.slip_ns = 0, NEVER
    state.count, state.events, state.said, state.said_ns, state.last_ns, state.way[:] = 0, 0, 0, NEVER, NEVER, 0.0
    state.suspected_at = 0.0
    put_certain(config, contact)


@part
def put_certain(config: FrictionConfig, contact: ContactEstimate) -> None:
    """Write what is certain to be carried: of unknown friction no more than has been."""
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
    """Let the load of a cycle count as carried, once the slip sensor would have shown otherwise."""
    i = index_at(state, now_ns - config.sensor_delay_ns)
    if contact.slipping == 0 and state.loads[i].stamp_ns <= now_ns - config.sensor_delay_ns:
        load = state.loads[i]
        contact.carried = min(max(contact.carried, load.commanded), contact.F_median)
        state.most_carried = max(state.most_carried, min(load.commanded, load.measured, contact.F_median))


@part
def slipping_load(config: FrictionConfig, state: FrictionEvidence, i: int) -> float:
    """Return the load [N] that counts where the contact slipped at the stamp of place i.

    The measured one is a mean: noise of a single wrench, of which the least counts, was learnt with every slip.
    """
    load, total, count = state.loads[i], 0.0, 0
    for k in range(min(state.count, LOADS)):
        other = state.loads[k]
        if abs(other.stamp_ns - load.stamp_ns) <= config.noise_ns:
            total, count = total + other.measured, count + 1
    measured = total / count
    return float(max(min(measured, load.commanded), config.trust * measured))


@part
def gives_way(
    config: FrictionConfig, contact: ContactEstimate, state: FrictionEvidence, stamp_ns: int, step: Spatial
) -> bool:
    """Return whether a slip may be pads that give way before they slip: to and fro, not far from where it began.

    Soft pads give way the faster the load changes, whatever it is, and friction does not end far below what it has
    carried: half of it, or a quarter of what it had carried before slips showed less. step: since the last sample [m].
    """
    way = spatial(state.way) + step
    put_spatial(state.way, way)
    length, i = math.sqrt(way.dot(way)), index_at(state, stamp_ns)
    if length < config.pre_sliding:
        return True
    doubted = PLAUSIBLE * max(contact.carried, PLAUSIBLE * state.most_carried)
    return length < GIVES_M and slipping_load(config, state, i) < doubted


@part
def slip_sample(
    config: FrictionConfig,
    contact: ContactEstimate,
    state: FrictionEvidence,
    stamp_ns: int,
    slip: Spatial,
    found: bool,
) -> None:
    """Take a slip sample: whether it slips, and friction where a slip begins.

    A single sample may be an outlier: it takes several in a row, or fewer that the observer confirms. One that is
    faster than a slip can have become since the sample before is an outlier, and is left out; a perfect sensor has
    none, and what lasts is none. Only the first sample of a slip tells where friction ended: what loads there are while
    it slides is the sliding friction and the law's doing.

    Args:
        config, contact, state: how friction is estimated; what is known of it, changed.
        stamp_ns: when the sample was measured.
        slip: S v_s, turning at the torsional radius [m/s]; of a flag: infinite or 0.
        found: whether the observer finds slip.

    Implements: ours: F^ <- min(F^, 0.95 min(|S^-1 h_ee|, |l(a_C)|)) at the stamp of the first slip sample.
    """
    speed, slips = math.sqrt(slip.dot(slip)), contact.slipping != 0
    if not speed > (OBSERVED if found else 1.0) * config.threshold:
        state.said, state.way[:], state.last_ns = 0, 0.0, stamp_ns
        if slips and stamp_ns - contact.slip_ns >= config.quiet_ns:
            contact.slipping = 0
        return
    known = NEVER < state.last_ns <= stamp_ns
    passed_s = 1e-9 * (stamp_ns - state.last_ns) if known else 0.0
    too_fast = known and config.witnesses > 1 and speed > config.threshold + FASTEST_GROWTH * passed_s
    if too_fast and (slips or state.said == 0):
        return
    stays = not slips and gives_way(config, contact, state, stamp_ns, passed_s * slip)
    state.last_ns = stamp_ns
    if stays:
        return
    if state.said == 0:
        state.said_ns = stamp_ns
    state.said += 1
    if not slips and state.said < (config.confirmed if found else config.witnesses):
        return
    contact.slipping, contact.slip_ns = 1, max(stamp_ns, contact.slip_ns)
    if not slips:
        learn_carried(config, contact, state, slipping_load(config, state, index_at(state, state.said_ns)))


@part
def suspect(config: FrictionConfig, contact: ContactEstimate, state: FrictionEvidence, found: bool) -> None:
    """Let the load at which the observer finds a slip bound what is certain, until a slip sample confirms or denies it.

    Samples come late. Nothing is learnt from the observer alone: with its finding the bound ends.
    """
    if not found:
        state.suspected_at = 0.0
    elif contact.slipping != 0:
        state.suspected_at = math.inf
    elif state.suspected_at == 0.0:
        load = slipping_load(config, state, (state.count - 1) % LOADS)
        state.suspected_at = load if load > LEAST_FRICTION * contact.F_median else math.inf
    if state.suspected_at > 0.0:
        contact.F_lo = min(contact.F_lo, config.kept * state.suspected_at)


@part
def learn_carried(config: FrictionConfig, contact: ContactEstimate, state: FrictionEvidence, carried: float) -> None:
    """Take the load [N at the nominal grip] that a slip left of what was asked.

    It is what friction carries while it slides, no more than before: so nothing here depends on the slip sensor.
    """
    learnt = max(config.kept * carried, config.least)
    if config.friction != Friction.KNOWN and learnt < contact.F_median:
        contact.F_median, contact.slipped_at = learnt, carried
        contact.carried = min(contact.carried, learnt)
        state.events += 1


# -- several pads


@part
def take_weaker(out: ContactEstimate, pad: ContactEstimate) -> None:
    """Let the estimate of all pads count with another pad where that one is weaker."""
    if pad.F_median < out.F_median:
        out.F_median, out.slipped_at = pad.F_median, pad.slipped_at
    out.F_lo = min(out.F_lo, pad.F_lo)
    out.carried, out.first = min(out.carried, pad.carried), min(out.first, pad.first)
    out.slipping, out.slip_ns = max(out.slipping, pad.slipping), max(out.slip_ns, pad.slip_ns)


@part
def share_friction(config: FrictionConfig, pad: ContactEstimate, weakest: ContactEstimate, now_ns: int) -> None:
    """Let a pad, or the weakest itself, know what all pads together have: friction, and whether any slips.

    A slip of several pads is over when no sample of any has shown one for so long.
    """
    pad.F_lo, pad.F_median, pad.slipped_at = weakest.F_lo, weakest.F_median, weakest.slipped_at
    pad.slip_ns = weakest.slip_ns
    lasts_ns = config.quiet_ns + config.sensor_delay_ns
    pad.slipping = 1 if weakest.slipping != 0 and now_ns - weakest.slip_ns < lasts_ns else 0
