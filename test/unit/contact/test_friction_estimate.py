"""The friction limit: learnt from slip samples, provisional from the observer, certain from what was carried."""

from types import SimpleNamespace

import numpy as np
import pytest

from slip_core.records import new, record
from slip_core.vectors import ZERO, Spatial, Vec
from slip_vic_controller.contact.friction_estimate import (
    ESTIMATE,
    ESTIMATE_CONFIG,
    GIVES_M,
    LEAST_FRICTION,
    LOAD_HISTORY,
    OBSERVED,
    PLAUSIBLE,
    Friction,
    certain,
    certify,
    first_friction,
    provisional,
    remember,
    slip_sample,
    start_estimate,
    suspect,
)

CONFIGURED, KEPT, CALMED, THRESHOLD, DELAY_NS = 1.0, 0.95, 0.985, 0.02, 100_000_000
MS = 1_000_000


def estimate(friction: Friction = Friction.LEARNT, **values: float) -> SimpleNamespace:
    """Return config, state and history of a contact at rest that is configured to carry 1 N."""
    config, state, history = (record(new(dtype), dtype) for dtype in (ESTIMATE_CONFIG, ESTIMATE, LOAD_HISTORY))
    config.friction, config.configured, config.kept, config.least, config.probe = friction, CONFIGURED, KEPT, 0.01, 0.02
    config.calmed = CALMED
    config.threshold, config.quiet_ns, config.sensor_delay_ns, config.trust = THRESHOLD, 50 * MS, DELAY_NS, 0.7
    for name, value in values.items():
        config[name] = value
    start_estimate(config, state, history, 0.1, 0.0)
    return SimpleNamespace(config=config, state=state, history=history)


def carry(e: SimpleNamespace, ms: int, load: float) -> None:
    """Remember a load that is commanded and measured [N]."""
    remember(e.history, ms * MS, load, load)


def sample(e: SimpleNamespace, stamp_ms: float, speed: float, found: bool = False) -> bool:
    """Take a slip sample along one axis [m/s, signed]; return whether it lowers the limit."""
    slip = Spatial(Vec(speed, 0.0, 0.0), ZERO)
    before = float(e.state.F_hat)
    learns = bool(slip_sample(e.config, e.state, e.history, round(stamp_ms * MS), slip, found))
    assert learns == (e.state.F_hat < before)
    return learns


def cycle(e: SimpleNamespace, ms: int, load: float, found: bool, speed: float = 0.0, weight: float = 0.0) -> float:
    """Do one cycle; return the friction limit that is planned with."""
    carry(e, ms, load)
    suspect(e.config, e.state, e.history, ms * MS, found, speed, weight)
    return float(certain(e.config, e.state, 1.0))


@pytest.mark.parametrize(("friction", "rests_with", "first"), [
    (Friction.LEARNT, 1.1, 1.1 / KEPT),
    (Friction.LEARNT, 0.98, CONFIGURED),
    (Friction.LEARNT, 0.0, CONFIGURED),  # not weighed
    (Friction.UNKNOWN, 1.1, CONFIGURED),
    (Friction.KNOWN, 1.1, CONFIGURED),
])  # fmt: skip
def test_load_at_rest_raises_first_limit(friction: Friction, rests_with: float, first: float) -> None:
    e = estimate(friction)
    assert first_friction(e.config, rests_with) == first
    start_estimate(e.config, e.state, e.history, 1.1, rests_with)
    assert (e.state.F_hat, e.state.first) == (first, first)


# -- suspicion of the observer


def test_suspicion_limits_the_plan() -> None:
    e = estimate()
    assert cycle(e, 0, 0.7, found=False) == CONFIGURED
    assert np.isclose(cycle(e, 1, 0.8, found=True), KEPT * 0.8)
    assert np.isclose(cycle(e, 2, 0.6, found=False), KEPT * 0.8), "the end of that slip takes nothing back"
    assert (e.state.F_hat, e.state.events, e.state.slipping) == (CONFIGURED, 0, 0), "nothing is learnt by it"


def test_fast_sensor_overrides_the_observer() -> None:
    e = estimate(sensor_delay_ns=0)
    assert cycle(e, 0, 0.8, found=True, speed=2.0 * THRESHOLD) == CONFIGURED


@pytest.mark.parametrize(("friction", "load", "weight", "limit"), [
    (Friction.LEARNT, 0.9 * LEAST_FRICTION, 0.0, CONFIGURED),  # so little friction is implausible
    (Friction.LEARNT, 1.1 * LEAST_FRICTION, 0.0, KEPT * 1.1 * LEAST_FRICTION),
    (Friction.LEARNT, 0.8, 0.81, CONFIGURED),  # the weight alone loads more
    (Friction.KNOWN, 0.8, 0.0, CONFIGURED),
])  # fmt: skip
def test_implausible_suspicion_is_ignored(friction: Friction, load: float, weight: float, limit: float) -> None:
    assert cycle(estimate(friction), 0, load, found=True, weight=weight) == limit


def test_suspicion_never_raises_the_limit() -> None:
    e = estimate()
    e.state.F_hat, e.state.slipped_at = 0.5, 0.55
    cycle(e, 0, 0.8, found=True)
    assert provisional(e.config, e.state) == (0.5, 0.55)


@pytest.mark.parametrize(("stamp_ms", "noise_ms", "stays"), [
    (5, 0, True), (9, 0, True), (10, 0, False), (20, 0, False), (16, 10, True), (22, 10, False),
])  # fmt: skip
def test_sensor_at_rest_withdraws_suspicion(stamp_ms: int, noise_ms: int, stays: bool) -> None:
    """Only a sample of the time from which the slip must be visible does."""
    e = estimate(noise_ns=noise_ms * MS)
    for ms in range(30):
        cycle(e, ms, 0.8, found=True, speed=2.0 * THRESHOLD if ms >= 10 else 0.5 * THRESHOLD)
    sample(e, stamp_ms, 0.0)
    assert bool(e.state.suspected) is stays
    assert (cycle(e, 30, 0.8, found=True) == CONFIGURED) is not stays, "the same slip is not found twice"


def test_denied_slip_returns_once_it_grows() -> None:
    e = estimate()
    cycle(e, 0, 0.8, found=True, speed=2.0 * THRESHOLD)
    sample(e, 5, 0.0)
    for ms, speed in ((6, 1.9), (7, 0.5), (8, 1.4)):
        cycle(e, ms, 0.9, found=True, speed=speed * THRESHOLD)
        assert e.state.suspected == 0, speed
    cycle(e, 9, 0.9, found=True, speed=1.6 * THRESHOLD)
    assert (e.state.suspected, e.state.suspected_at) == (1, 0.9), "as fast as counts, and a threshold more than before"


@pytest.mark.parametrize("speed", [0.0, 3.0])
def test_slip_already_seen_is_ignored(speed: float) -> None:
    e = estimate()
    e.state.slipping = 1
    cycle(e, 0, 0.8, found=True, speed=speed * THRESHOLD)
    e.state.slipping = 0
    cycle(e, 1, 0.8, found=True, speed=3.5 * THRESHOLD)
    assert e.state.suspected == (speed == 0.0)


def test_growing_slip_lowers_suspicion() -> None:
    e = estimate()
    for ms in range(4000):
        F = cycle(e, ms, 0.8, found=True, speed=1e-6 * ms)
        assert np.isclose(F, max(0.8 * KEPT ** (ms // 101 + 1), KEPT * LEAST_FRICTION))
    assert np.isclose(F, KEPT * LEAST_FRICTION)


@pytest.mark.parametrize(("speed", "factor"), [(3.0, 1.0), (5.0, KEPT)])
def test_faster_slip_found_again_has_grown(speed: float, factor: float) -> None:
    e = estimate()
    cycle(e, 0, 0.8, found=True, speed=3.0 * THRESHOLD)
    for ms in range(1, 102):
        cycle(e, ms, 0.8, found=False)
    assert np.isclose(cycle(e, 102, 0.8, found=True, speed=speed * THRESHOLD), KEPT * 0.8 * factor)


def test_growth_within_noise_is_ignored() -> None:
    e = estimate(growth=THRESHOLD)
    for ms in range(400):
        limit = cycle(e, ms, 0.9 if ms == 0 else 0.6, found=True, speed=0.001 + 0.9 * THRESHOLD * (ms % 2))
    assert np.isclose(limit, KEPT * 0.9)


def test_lasting_load_calms_suspicion() -> None:
    e = estimate()
    cycle(e, 0, 0.9, found=True, speed=0.001)
    for ms in range(1, 202):
        limit = cycle(e, ms, 0.6, found=True, speed=0.001 * (1 + ms))
    assert np.isclose(limit, KEPT * KEPT * 0.9), "a slip that grows lowers it"
    for first, last, load, expected in (
        (202, 503, 0.88, KEPT * KEPT * 0.9),  # not yet
        (503, 505, 0.88, CALMED * min(0.88 / CALMED, 0.9)),
        (505, 900, 5.0, CALMED * 0.9),  # never what has slipped
    ):
        for ms in range(first, last):
            limit = cycle(e, ms, load, found=False)
        assert np.isclose(limit, expected)
    assert np.isclose(cycle(e, 900, 0.88, found=True), KEPT * 0.9), "a new slip ends the calm"


# -- slip samples


@pytest.mark.parametrize(("noise_ms", "expected"), [(0, 0.7), (3, 0.8), (1, (0.9 + 0.7 + 0.9) / 3)])
def test_noisy_load_is_averaged(noise_ms: int, expected: float) -> None:
    e = estimate(noise_ns=noise_ms * MS)
    for ms in range(20):
        remember(e.history, ms * MS, {10: 0.7, 9: 0.9, 11: 0.9, 8: 0.8, 12: 0.8, 7: 0.7, 13: 0.8}.get(ms, 5.0), 1.0)
    assert sample(e, 10, 2.0 * THRESHOLD)
    assert np.isclose(e.state.slipped_at, expected)


def test_commanded_load_bounds_the_average() -> None:
    e = estimate(noise_ns=3 * MS)
    for ms in range(20):
        remember(e.history, ms * MS, 0.8 + 0.1 * (-1.0) ** ms, 0.75)
    assert sample(e, 10, 2.0 * THRESHOLD)
    assert np.isclose(e.state.slipped_at, 0.75)


@pytest.mark.parametrize(("friction", "limit"), [
    (Friction.LEARNT, KEPT * 0.8), (Friction.UNKNOWN, KEPT * 0.8), (Friction.KNOWN, CONFIGURED),
])  # fmt: skip
def test_only_the_onset_teaches(friction: Friction, limit: float) -> None:
    """What is carried while it slides is sliding friction."""
    e = estimate(friction)
    for ms, load in enumerate((0.8, 0.5, 0.3)):
        carry(e, ms, load)
        assert sample(e, ms, 2.0 * THRESHOLD) == (limit < CONFIGURED and ms == 0)
        assert e.state.slipping == 1
        assert np.isclose(e.state.F_hat, limit)
        assert e.state.events == (limit < CONFIGURED)


@pytest.mark.parametrize(("confirmed", "speeds", "found", "first"), [
    (1, (2.0, 2.0, 0.0, 2.0, 2.0), False, None), (1, (2.0, 2.0, 2.0), False, 0), (1, (0.0, 2.0), True, 1),
    (2, (0.0, 2.0, 0.0, 2.0), True, None), (2, (0.0, 2.0, 2.0), True, 1),
])  # fmt: skip
def test_slip_takes_several_samples(confirmed: int, speeds: tuple[float, ...], found: bool, first: int | None) -> None:
    """Three in a row, or as many as `confirmed` while the observer finds slip; the load of the first one counts."""
    e = estimate(witnesses=3, confirmed=confirmed)
    for ms in range(200):
        carry(e, ms, 0.5 + 0.001 * ms)
    for k, speed in enumerate(speeds):
        sample(e, 100 + 10 * k, speed * THRESHOLD, found)
    assert bool(e.state.slipping) == (first is not None)
    assert np.isclose(e.state.F_hat, CONFIGURED if first is None else KEPT * (0.6 + 0.01 * first))


@pytest.mark.parametrize(("speed", "lasts"), [(2.0, True), (30.0, False)])
def test_slip_ends_when_quiet(speed: float, lasts: bool) -> None:
    """A single sample keeps it up, but no outlier: 30 thresholds are more than a slip gains within 19 ms."""
    e = estimate(witnesses=3)
    carry(e, 0, 0.5)
    for stamp_ms, now, slips in (
        (10, 2.0, False), (15, 2.0, False), (20, 2.0, True), (21, 0.0, True), (39, 0.0, True), (40, speed, True),
        (69, 0.0, True), (70, 0.0, lasts), (89, 0.0, lasts), (90, 0.0, False), (91, 0.0, False),
    ):  # fmt: skip
        sample(e, stamp_ms, now * THRESHOLD)
        assert bool(e.state.slipping) is slips, stamp_ms


@pytest.mark.parametrize(("gap_ms", "slips"), [(1, False), (20, True)])
def test_impossible_speed_is_an_outlier(gap_ms: int, slips: bool) -> None:
    e = estimate(witnesses=3, confirmed=2)
    carry(e, 0, 0.5)
    sample(e, 0, 0.0)
    for k in range(2):
        sample(e, gap_ms + k, 0.3 + 0.1 * k, found=True)
    assert bool(e.state.slipping) is slips


@pytest.mark.parametrize(("speed", "back", "ticks", "slips"), [
    (1e-4, 1.0, 90, False), (1e-4, 1.0, 110, True), (2e-3, 1.0, 5, False), (2e-3, 1.0, 7, True),
    (2e-3, -1.0, 2000, False),
])  # fmt: skip
def test_pre_sliding_is_no_slip(speed: float, back: float, ticks: int, slips: bool) -> None:
    e = estimate(threshold=5e-5, witnesses=1, pre_sliding=1e-5)
    for ms in range(ticks):
        carry(e, ms, 0.5)
        sample(e, ms, speed * (back if ms // 4 % 2 else 1.0))
    assert bool(e.state.slipping) is slips
    assert bool(e.state.F_hat < CONFIGURED) is slips


@pytest.mark.parametrize(("share", "gives", "slips"), [(0.9, 0.8, False), (0.9, 1.2, True), (1.1, 0.2, True)])
def test_implausible_load_takes_more_slip(share: float, gives: float, slips: bool) -> None:
    """Soft pads give way where a load changes fast, at far less than what was carried before."""
    speed, carried, load = 0.04, 0.8, share * PLAUSIBLE * 0.8
    e = estimate()
    for ms in range(150):
        carry(e, ms, carried)
        certify(e.config, e.state, e.history, ms * MS)
    assert e.state.carried == carried
    for ms in range(150, 150 + round(1e3 * gives * GIVES_M / speed)):
        carry(e, ms, load)
        sample(e, ms, speed)
    assert bool(e.state.slipping) is slips
    assert np.isclose(e.state.F_hat, KEPT * load if slips else CONFIGURED)


def test_brief_gap_is_the_same_slip() -> None:
    e = estimate()
    for ms in range(40):
        carry(e, ms, 0.8 if ms < 20 else 0.4)
    assert sample(e, 10, 2.0 * THRESHOLD)
    assert not sample(e, 25, 0.0)
    assert not sample(e, 30, 2.0 * THRESHOLD), "it slides at that load"
    assert (e.state.F_hat, e.state.events) == (KEPT * 0.8, 1)


@pytest.mark.parametrize(("suspected_at", "load"), [(0.7, 0.8), (0.8, 0.7)])
def test_smaller_onset_load_teaches(suspected_at: float, load: float) -> None:
    e = estimate()
    for ms in range(20):
        cycle(e, ms, suspected_at if ms < 10 else load, found=True)
    assert sample(e, 15, 2.0 * THRESHOLD, found=True)
    assert (e.state.suspected, e.state.slipping) == (0, 1)
    assert np.isclose(e.state.F_hat, KEPT * 0.7)
    assert np.isclose(e.state.slipped_at, 0.7)


@pytest.mark.parametrize(("before", "after"), [(0.9, KEPT * 0.8), (0.3, 0.3)])
def test_slip_lowers_what_is_certain(before: float, after: float) -> None:
    e = estimate(Friction.UNKNOWN)
    e.state.F_hat, e.state.certified = CONFIGURED, before
    carry(e, 0, 0.8)
    assert sample(e, 10, 2.0 * THRESHOLD)
    assert np.isclose(e.state.certified, after)
    assert (e.state.events, e.state.event_ns) == (1, 10 * MS)


@pytest.mark.parametrize(("share", "found", "slips"), [
    (0.5 + 0.5 * OBSERVED, True, True), (0.5 + 0.5 * OBSERVED, False, False), (0.9 * OBSERVED, True, False),
    (1.1, False, True),
])  # fmt: skip
def test_observer_lowers_the_threshold(share: float, found: bool, slips: bool) -> None:
    e = estimate()
    carry(e, 0, 0.5)
    sample(e, 10, share * THRESHOLD, found)
    assert bool(e.state.slipping) is slips


def test_carried_load_counts_after_the_delay() -> None:
    e = estimate(sensor_delay_ns=20 * MS)
    config, state, history = e.config, e.state, e.history
    state.F_hat, state.certified = 2.5, 0.0
    certify(config, state, history, 0)
    assert state.certified == 0.0
    for k, load in enumerate((1.0, 2.0, 1.5, 9.0)):
        history.loads[k].stamp_ns, history.loads[k].commanded, history.count = 10 * MS * (k + 1), load, k + 1
    for now_ms, carried in ((29, 0.0), (30, 1.0), (40, 2.0), (50, 2.0), (60, 2.5)):
        certify(config, state, history, now_ms * MS)
        assert state.certified == carried, now_ms
    state.slipping, state.certified = 1, 0.0
    certify(config, state, history, 60 * MS)
    assert state.certified == 0.0
