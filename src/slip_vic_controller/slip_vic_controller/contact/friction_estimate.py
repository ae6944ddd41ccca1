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


class LoadHistory(Record):
    """Loads of the last cycles."""

    count: Whole
    loads: Annotated[Records[Load], LOADS]


class EstimateConfig(Record):
    """How friction is estimated."""

    friction: Whole  # Friction
    configured: Real  # N, mu N as configured, or the most that is ever probed
    kept: Real  # share of the load at which it slipped
    least: Real  # N, floor of F^
    probe: Real  # N, eps: load beyond the certified one
    pre_sliding: Real  # m, way that pads give before they slip
    threshold: Real  # m/s, slip speed |S v_s| that counts
    witnesses: Whole  # samples in a row that must show it
    confirmed: Whole  # the same where the observer finds slip too
    quiet_ns: Whole  # without slip for so long, it holds again
    sensor_delay_ns: Whole  # age at which a cycle's load is known to have been carried
    trust: Real  # least that the model's load may be of the measured one; below it the model is not used
    noise_ns: Whole  # loads so long before and after a stamp are averaged


class Estimate(Record):
    """What friction is taken to be."""

    F_hat: Real  # N, F^
    first: Real  # N, F^ at first
    slipped_at: Real  # N, smallest load at which it has slipped, in the model's units; 0 before
    certified: Real  # N, largest load carried without slip
    carried: Real  # N, the same, whatever slips have shown since
    slipping: Whole
    slip_ns: Whole  # stamp of the newest slip sample
    events: Whole  # how often F^ was made smaller
    event_ns: Whole  # stamp of the last time
    said: Whole  # samples in a row that show slip
    said_ns: Whole  # stamp of the first of them
    last_ns: Whole  # and of the newest sample that is no outlier
    way: Vec6  # m, that they have slipped; turning at the torsional radius


LOAD, LOAD_HISTORY = dtype_of(Load), dtype_of(LoadHistory)
ESTIMATE_CONFIG, ESTIMATE = dtype_of(EstimateConfig), dtype_of(Estimate)


@part
def first_friction(config: EstimateConfig, rests_with: float) -> float:
    """Return the friction to begin with [N]: as configured, or what the object at rest disproves that with.

    What rests is carried: an object that was weighed and loads the grasp by more than friction as configured is held by
    more. Its load counts as that of a slip would: 1/0.95 of it is carried.

    Args:
        config: ESTIMATE_CONFIG.
        rests_with: load at rest that a tare has found [N]; 0 where it is the configuration's.
    """
    disproved = config.friction == Friction.LEARNT and rests_with > config.configured
    return float(rests_with / config.kept if disproved else config.configured)


@part
def start_estimate(
    config: EstimateConfig, state: Estimate, history: LoadHistory, at_rest: float, rests_with: float
) -> None:
    """Begin with what is configured, or with what the object's weight shows.

    at_rest: load at rest [N]; rests_with: see `first_friction`.
    """
    state.F_hat = state.first = first_friction(config, rests_with)
    state.slipped_at = 0.0
    state.certified = state.carried = min(at_rest + config.probe, state.first)
    state.slipping, state.slip_ns, state.events, state.event_ns = 0, NEVER, 0, NEVER
    state.said, state.said_ns, state.last_ns, state.way[:] = 0, NEVER, NEVER, 0.0
    history.count = 0


@part
def remember(history: LoadHistory, stamp_ns: int, measured: float, commanded: float) -> None:
    """Add the load measured at a stamp, and what the cycle before had commanded [N]."""
    place = history.loads[history.count % LOADS]
    place.stamp_ns, place.measured, place.commanded = stamp_ns, measured, commanded
    history.count += 1


@part
def index_at(history: LoadHistory, stamp_ns: int) -> int:
    """Return the place of the newest load that is not younger than a stamp, else of the oldest; -1: there is none."""
    newest = history.count - 1
    oldest = max(history.count - LOADS, 0)
    if newest < 0:
        return -1
    while newest > oldest and history.loads[newest % LOADS].stamp_ns > stamp_ns:
        newest -= 1
    return int(newest % LOADS)


@part
def certify(config: EstimateConfig, state: Estimate, history: LoadHistory, now_ns: int) -> None:
    """Let the load of a cycle count as carried, once the slip sensor would have shown otherwise."""
    if state.slipping != 0:
        return
    i = index_at(history, now_ns - config.sensor_delay_ns)
    if i >= 0 and history.loads[i].stamp_ns <= now_ns - config.sensor_delay_ns:
        load = history.loads[i]
        state.certified = min(max(state.certified, load.commanded), state.F_hat)
        state.carried = max(state.carried, min(load.commanded, load.measured, state.F_hat))


@part
def slipping_load(config: EstimateConfig, history: LoadHistory, i: int) -> float:
    """Return the load [N] that counts where the contact slipped at the stamp of place i.

    The measured one is a mean: noise of a single wrench, of which the least counts, was learnt with every slip.
    """
    load, total, count = history.loads[i], 0.0, 0
    for k in range(min(history.count, LOADS)):
        other = history.loads[k]
        if abs(other.stamp_ns - load.stamp_ns) <= config.noise_ns:
            total, count = total + other.measured, count + 1
    measured = total / count
    return float(max(min(measured, load.commanded), config.trust * measured))


@part
def is_outlier(config: EstimateConfig, state: Estimate, stamp_ns: int, speed: float) -> bool:
    """Return whether a slip cannot have become as fast as this [m/s] since the newest sample.

    A perfect sensor has none. What lasts is none: the time since then grows.
    """
    if config.witnesses == 1 or not NEVER < state.last_ns <= stamp_ns:
        return False
    return speed > config.threshold + FASTEST_GROWTH * 1e-9 * (stamp_ns - state.last_ns)


@part
def gives_way(config: EstimateConfig, state: Estimate, history: LoadHistory, stamp_ns: int, slip: Spatial) -> bool:
    """Return whether a slip may be pads that give way before they slip: to and fro, not far from where it began.

    Soft pads give way the faster the load changes, whatever it is, and friction does not end far below what it has
    carried: half of it, or a quarter of what it had carried before slips showed less.
    """
    passed_s = 1e-9 * (stamp_ns - state.last_ns) if NEVER < state.last_ns <= stamp_ns else 0.0
    way = spatial(state.way) + passed_s * slip
    put_spatial(state.way, way)
    length, i = math.sqrt(way.dot(way)), index_at(history, stamp_ns)
    if length < config.pre_sliding:
        return True
    doubted = PLAUSIBLE * max(state.certified, PLAUSIBLE * state.carried)
    return i >= 0 and length < GIVES_M and slipping_load(config, history, i) < doubted


@part
def slip_sample(
    config: EstimateConfig, state: Estimate, history: LoadHistory, stamp_ns: int, slip: Spatial, found: bool
) -> bool:
    """Take a slip sample; return whether F^ has become smaller.

    A single sample may be an outlier: it takes several in a row, or fewer that the observer confirms. One that is
    faster than a slip can have become since the sample before is an outlier, and is left out. Only the first sample of
    a slip tells where friction ended: what loads there are while it slides is the sliding friction and the law's doing.

    Args:
        config, state, history: ESTIMATE_CONFIG, ESTIMATE, LOAD_HISTORY.
        stamp_ns: when the sample was measured.
        slip: S v_s, turning at the torsional radius [m/s]; of a flag: infinite or 0.
        found: whether the observer finds slip.

    Implements: ours: F^ <- min(F^, 0.95 min(|S^-1 h_ee|, |l(a_C)|)) at the stamp of the first slip sample.
    """
    speed = math.sqrt(slip.dot(slip))
    if not speed > (OBSERVED if found else 1.0) * config.threshold:
        state.said, state.way[:], state.last_ns = 0, 0.0, stamp_ns
        if state.slipping != 0 and stamp_ns - state.slip_ns >= config.quiet_ns:
            state.slipping = 0
        return False
    if (state.slipping != 0 or state.said == 0) and is_outlier(config, state, stamp_ns, speed):
        return False
    stays = state.slipping == 0 and gives_way(config, state, history, stamp_ns, slip)
    state.last_ns = stamp_ns
    if stays:
        return False
    if state.said == 0:
        state.said_ns = stamp_ns
    state.said += 1
    first = state.slipping == 0
    if first and state.said < (config.confirmed if found else config.witnesses):
        return False
    state.slipping, state.slip_ns = 1, max(stamp_ns, state.slip_ns)
    i = index_at(history, state.said_ns)
    if not first or i < 0 or config.friction == Friction.KNOWN:
        return False
    return bool(learn_carried(config, state, slipping_load(config, history, i), stamp_ns))


@part
def learn_carried(config: EstimateConfig, state: Estimate, carried: float, stamp_ns: int) -> bool:
    """Take the load [N at the nominal grip] that a slip left of what was asked; return whether F^ has become smaller.

    It is what friction carries while it slides, no more than before: so nothing here depends on the slip sensor.
    """
    learnt = max(config.kept * carried, config.least)
    if config.friction == Friction.KNOWN or learnt >= state.F_hat:
        return False
    state.F_hat, state.slipped_at = learnt, carried
    state.certified = min(state.certified, learnt)
    state.events += 1
    state.event_ns = stamp_ns
    return True
