"""What friction the contact has: told, learnt from where it slipped, or probed.

Nothing but loads is used, no friction law. A slip sample comes late and tells of its own stamp, so a short history of
loads is kept, and the load at that stamp counts.

The observer finds a slip in the wrench long before a slow sensor's sample of it arrives, but with a wrong model it
finds slips that are none. So its word is provisional: the path is planned for the load at which it found the slip, the
law is not told, and the guard holds nothing back for it, until the slip sensor does not see what it would have to see.
"""

from __future__ import annotations

from enum import IntEnum, unique
from typing import Any, Final

from slip_core.compiled import part
from slip_core.records import REAL, WHOLE, layout
from slip_vic_controller.sizes import NEVER

LOADS: Final = 256
"""Control cycles that the history goes back."""
PLAUSIBLE: Final = 0.5
"""Share of what is known of friction below which a slip that the observer alone finds is the model's error."""


@unique
class Friction(IntEnum):
    """Where the friction limit comes from."""

    KNOWN = 0
    LEARNT = 1
    UNKNOWN = 2


LOAD = layout(stamp_ns=WHOLE, measured=REAL, commanded=REAL)
"""At a stamp: |S^-1 Sigma h_ee|, and |l(a_C)| of the command that led to it, which is that of the cycle before [N]."""
LOAD_HISTORY = layout(count=WHOLE, loads=(LOAD, (LOADS,)))
ESTIMATE_CONFIG = layout(
    friction=WHOLE,
    told=REAL,
    kept=REAL,
    least=REAL,
    probe=REAL,
    threshold=REAL,
    witnesses=WHOLE,
    quiet_ns=WHOLE,
    sensor_delay_ns=WHOLE,
    trust=REAL,
)
"""friction: Friction; told: mu N as told, or the most that is ever probed [N]; kept: share of the load at which it
slipped; least: floor of F^ [N]; probe: eps, load beyond the certified one [N]; threshold: slip speed |S v_s| that
counts [m/s]; witnesses: how many samples in a row must show it; quiet_ns: without slip for so long, it holds again;
sensor_delay_ns: age at which a cycle's load is known to have been carried; trust: least that the model's load may be of
the measured one: below it, the model is not believed (an object lighter than told by more than this)."""
ESTIMATE = layout(
    F_hat=REAL, slipped_at=REAL, certified=REAL, slipping=WHOLE, slip_ns=WHOLE, events=WHOLE, event_ns=WHOLE,
    suspected=WHOLE, suspected_at=REAL, suspected_ns=WHOLE, suspected_speed=REAL, claimed_ns=WHOLE, found=WHOLE,
    said=WHOLE, said_ns=WHOLE,
)  # fmt: skip
"""F^ [N]; slipped_at: smallest load at which it has slipped, in the model's units, 0 before [N]; certified: largest
load carried without slip [N]; slipping, slip_ns: whether, and the stamp of the newest slip sample; events, event_ns:
how often F^ was made smaller, and the stamp of the last time. suspected, suspected_at: whether the observer alone has
told of a slip, and the load at which it did [N]; suspected_ns, suspected_speed: when that was looked at last, and
its speed of slip then [m/s]; claimed_ns: stamp since when it says that the slip sensor must see it; found: whether it
finds slip now. said, said_ns: how many samples in a row say slip, and the stamp of the first of them."""


@part
def start_estimate(config: Any, state: Any, history: Any, at_rest: float) -> None:
    """Begin with what is told, or with what the object's weight shows; at_rest: load at rest [N]."""
    state.F_hat, state.slipped_at = config.told, 0.0
    state.certified = min(at_rest + config.probe, config.told)
    state.slipping, state.slip_ns, state.events, state.event_ns = 0, NEVER, 0, NEVER
    state.suspected, state.suspected_at, state.claimed_ns, state.found = 0, 0.0, NEVER, 0
    state.suspected_ns, state.suspected_speed = 0, 0.0
    state.said, state.said_ns = 0, NEVER
    history.count = 0


@part
def remember(history: Any, stamp_ns: int, measured: float, commanded: float) -> None:
    """Add the load measured at a stamp, and what the cycle before had commanded [N]."""
    place = history.loads[history.count % LOADS]
    place.stamp_ns, place.measured, place.commanded = stamp_ns, measured, commanded
    history.count += 1


@part
def index_at(history: Any, stamp_ns: int) -> int:
    """Return the place of the newest load that is not younger than a stamp, else of the oldest; -1: there is none."""
    newest = history.count - 1
    oldest = max(history.count - LOADS, 0)
    if newest < 0:
        return -1
    while newest > oldest and history.loads[newest % LOADS].stamp_ns > stamp_ns:
        newest -= 1
    return int(newest % LOADS)


@part
def certify(config: Any, state: Any, history: Any, now_ns: int) -> None:
    """Let the load of a cycle count as carried, once the slip sensor would have told otherwise."""
    if state.slipping != 0:
        return
    i = index_at(history, now_ns - config.sensor_delay_ns)
    if i >= 0 and history.loads[i].stamp_ns <= now_ns - config.sensor_delay_ns:
        state.certified = min(max(state.certified, history.loads[i].commanded), state.F_hat)


@part
def carried(config: Any, load: Any) -> float:
    """Return the load [N] of a LOAD that counts where the contact slipped at it."""
    return float(max(min(load.measured, load.commanded), config.trust * load.measured))


@part
def slip_sample(config: Any, state: Any, history: Any, stamp_ns: int, speed: float, found: bool) -> bool:
    """Take a slip sample; return whether F^ has become smaller.

    A single sample may be an outlier: it takes several in a row, or one that the observer confirms. Only the first
    sample of a slip tells where friction ended: what loads there are while it slides is the sliding friction and the
    law's doing.

    Args:
        config, state, history: ESTIMATE_CONFIG, ESTIMATE, LOAD_HISTORY.
        stamp_ns: when the sample was measured.
        speed: |S v_s| [m/s]; of a flag: infinite or 0.
        found: whether the observer finds slip.

    Implements: ours: F^ <- min(F^, 0.95 min(|S^-1 h_ee|, |l(a_C)|)) at the stamp of the first slip sample.
    """
    if not speed > config.threshold:
        state.said = 0
        if state.suspected != 0 and state.claimed_ns != NEVER and stamp_ns >= state.claimed_ns:
            state.suspected = 0
        if state.slipping != 0 and stamp_ns - state.slip_ns >= config.quiet_ns:
            state.slipping = 0
        return False
    state.said_ns = stamp_ns if state.said == 0 else state.said_ns
    state.said += 1
    first = state.slipping == 0
    if first and state.said < config.witnesses and not found:
        return False
    state.slipping, state.slip_ns = 1, max(stamp_ns, state.slip_ns)
    i = index_at(history, state.said_ns)
    if not first or i < 0 or config.friction == Friction.KNOWN:
        return False
    slipped_at = carried(config, history.loads[i])
    if state.suspected != 0:
        state.suspected, slipped_at = 0, min(slipped_at, state.suspected_at)
    learnt = max(config.kept * slipped_at, config.least)
    if learnt >= state.F_hat:
        return False
    state.F_hat, state.slipped_at = learnt, slipped_at
    state.certified = min(state.certified, learnt)
    state.events += 1
    state.event_ns = stamp_ns
    return True


@part
def suspect(
    config: Any, state: Any, history: Any, stamp_ns: int, found: bool, speed: float, weight_load: float
) -> None:
    """Take the observer's word: whether it finds slip at this stamp, and how fast, |S v_s| [m/s].

    weight_load: largest load of the weight alone on the path [N]: no slower path helps where less than that slips.
    """
    if not found or config.friction == Friction.KNOWN or state.slipping != 0:
        state.claimed_ns = NEVER
    else:
        load = carried(config, history.loads[(history.count - 1) % LOADS])
        known = state.certified if config.friction == Friction.UNKNOWN else state.F_hat
        least = max(PLAUSIBLE * known, weight_load)
        if state.found == 0 and state.suspected == 0 and load > least:
            state.suspected, state.suspected_at = 1, load
            state.suspected_ns, state.suspected_speed = stamp_ns, speed
        elif state.suspected != 0 and stamp_ns - state.suspected_ns > config.sensor_delay_ns:
            if speed > state.suspected_speed:  # what is asked since then does not end that slip
                state.suspected_at = max(config.kept * state.suspected_at, PLAUSIBLE * known)
            state.suspected_ns, state.suspected_speed = stamp_ns, speed
        if speed <= config.threshold:
            state.claimed_ns = NEVER
        elif state.claimed_ns == NEVER:
            state.claimed_ns = stamp_ns
    state.found = 1 if found else 0


@part
def provisional(config: Any, state: Any) -> tuple[float, float]:
    """Return F^ and the load at which it slipped [N], the observer's word included."""
    if state.suspected == 0:
        return float(state.F_hat), float(state.slipped_at)
    F = max(config.kept * state.suspected_at, config.least)
    return float(min(F, state.F_hat)), float(state.suspected_at if state.F_hat > F else state.slipped_at)


@part
def certain(config: Any, state: Any, margin: float) -> float:
    """Return the load with which braking is planned [N]; margin: beta."""
    F, _ = provisional(config, state)
    return min(state.certified, margin * F) if config.friction == Friction.UNKNOWN else margin * F


@part
def allowed(config: Any, state: Any, margin: float) -> float:
    """Return the load that may be asked now [N]: with unknown friction a little more than what is certain."""
    if config.friction == Friction.UNKNOWN:
        return min(state.certified + config.probe, margin * state.F_hat)
    return float(margin * state.F_hat)


@part
def weaker(estimate: Any, pad: Any) -> None:
    """Let an ESTIMATE of all pads count with another pad where that one is weaker; each sensor sees its own pad."""
    if pad.F_hat < estimate.F_hat:
        estimate.F_hat, estimate.slipped_at = pad.F_hat, pad.slipped_at
    estimate.certified = min(estimate.certified, pad.certified)
    estimate.slipping, estimate.slip_ns = max(estimate.slipping, pad.slipping), max(estimate.slip_ns, pad.slip_ns)
    if pad.suspected != 0:
        known = estimate.suspected != 0
        estimate.suspected_at = min(estimate.suspected_at, pad.suspected_at) if known else pad.suspected_at
        estimate.suspected = 1


@part
def end_slip(config: Any, estimate: Any, now_ns: int) -> None:
    """End the slip of several pads when no sample of any has shown one for so long [ns]."""
    if estimate.slipping != 0 and now_ns - estimate.slip_ns >= config.quiet_ns + config.sensor_delay_ns:
        estimate.slipping = 0


@part
def take_weakest(pad: Any, estimate: Any) -> None:
    """Let a pad know what all pads together have: friction of the weakest one, and whether any slips."""
    pad.F_hat, pad.slipped_at = estimate.F_hat, estimate.slipped_at
    pad.slipping, pad.slip_ns = estimate.slipping, estimate.slip_ns
