"""The friction limit: learnt from slip samples, certain from what was carried, of several pads the weakest."""

from types import SimpleNamespace

import numpy as np
import pytest

from slip_core.vectors import ZERO, Spatial, Vec
from slip_vic_controller.contact.estimate import ContactEstimate
from slip_vic_controller.contact.friction_estimate import (
    GIVES_M,
    KEPT,
    OBSERVED,
    PLAUSIBLE,
    Friction,
    FrictionConfig,
    FrictionEvidence,
    certify,
    put_certain,
    remember,
    slip_sample,
    start_friction,
    suspect,
    take_weaker,
)
from slip_vic_controller.sizes import NEVER
from test.support.call import blank, left

CONFIGURED, THRESHOLD, DELAY_NS = 1.0, 0.02, 100_000_000
MS = 1_000_000


def estimate(friction: Friction = Friction.LEARNT, **values: float) -> SimpleNamespace:
    """Return config, estimate and evidence of a contact at rest that is configured to carry 1 N."""
    config, state, history = map(blank, (FrictionConfig, ContactEstimate, FrictionEvidence))
    config.friction, config.configured, config.least, config.probe = friction, CONFIGURED, 0.01, 0.02
    config.threshold, config.sensor_delay_ns = THRESHOLD, DELAY_NS
    for name, value in values.items():
        config[name] = value
    start_friction(config, state, history, 0.1, 0.0)
    return SimpleNamespace(config=config, state=state, history=history)


def carry(e: SimpleNamespace, ms: int, load: float) -> None:
    """Remember a load that is commanded and measured [N]."""
    remember(e.history, ms * MS, load, load)


def sample(e: SimpleNamespace, stamp_ms: float, speed: float, found: bool = False) -> bool:
    """Take a slip sample along one axis [m/s, signed]; return whether it lowers the limit."""
    slip = Spatial(Vec(speed, 0.0, 0.0), ZERO)
    before = float(e.state.F_median)
    slip_sample(e.config, e.state, e.history, round(stamp_ms * MS), slip, found)
    return bool(e.state.F_median < before)


@pytest.mark.parametrize(("friction", "rests_with", "first"), [
    (Friction.LEARNT, 1.1, 1.1 / KEPT),
    (Friction.LEARNT, 0.98, CONFIGURED),
    (Friction.LEARNT, 0.0, CONFIGURED),  # not weighed
    (Friction.UNKNOWN, 1.1, CONFIGURED),
    (Friction.KNOWN, 1.1, CONFIGURED),
])  # fmt: skip
def test_load_at_rest_raises_first_limit(friction: Friction, rests_with: float, first: float) -> None:
    e = estimate(friction)
    start_friction(e.config, e.state, e.history, 1.1, rests_with)
    assert (e.state.F_median, e.state.first) == (first, first)


# -- what the observer finds before a late sample shows it


def suspected(e: SimpleNamespace, found: bool) -> float:
    """Return what is certain to be carried after a cycle in which the observer finds slip or not [N]."""
    put_certain(e.config, e.state)
    suspect(e.config, e.state, e.history, found)
    return float(e.state.F_lo)


def test_finding_of_the_observer_bounds_what_is_certain_while_it_lasts() -> None:
    e = estimate()
    carry(e, 0, 0.8)
    assert suspected(e, found=True) == pytest.approx(KEPT * 0.8)
    carry(e, 1, 0.5)  # what is asked meanwhile is no evidence
    assert suspected(e, found=True) == pytest.approx(KEPT * 0.8)
    assert suspected(e, found=False) == CONFIGURED == e.state.F_median


def test_slip_sample_denies_what_the_observer_found_before_it() -> None:
    e = estimate()
    for ms in (5, 15):  # anew where it finds slip again
        carry(e, ms, 0.8)
        for sample_ms, bound in ((ms - 1, KEPT * 0.8), (ms, KEPT * 0.8), (ms + 1, CONFIGURED)):
            assert not sample(e, sample_ms, 0.4 * THRESHOLD, found=True)
            assert suspected(e, found=True) == pytest.approx(bound)
        assert suspected(e, found=False) == CONFIGURED


@pytest.mark.parametrize(("load", "slipping"), [(0.3, 0), (0.8, 1)])
def test_small_load_and_known_slip_bound_nothing(load: float, slipping: int) -> None:
    e = estimate()
    e.state.slipping = slipping
    carry(e, 0, load)
    assert suspected(e, found=True) == CONFIGURED


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
        assert np.isclose(e.state.F_median, limit)
        assert e.history.events == (limit < CONFIGURED)


@pytest.mark.parametrize(("confirmed", "speeds", "found", "first"), [
    (1, (2.0, 2.0, 0.0, 2.0, 2.0), False, None), (1, (2.0, 2.0, 2.0), False, 0), (1, (0.0, 2.0), True, 1),
    (2, (0.0, 2.0, 0.0, 2.0), True, None), (2, (0.0, 2.0, 2.0), True, 1),
])  # fmt: skip
def test_slip_takes_several_samples(confirmed: int, speeds: tuple[float, ...], found: bool, first: int | None) -> None:
    """Three in a row, or as many as `confirmed` while the observer finds slip; the load of the first one counts."""
    e = estimate(slip_count=3, confirmed=confirmed)
    for ms in range(200):
        carry(e, ms, 0.5 + 0.001 * ms)
    for k, speed in enumerate(speeds):
        sample(e, 100 + 10 * k, speed * THRESHOLD, found)
    assert bool(e.state.slipping) == (first is not None)
    assert np.isclose(e.state.F_median, CONFIGURED if first is None else KEPT * (0.6 + 0.01 * first))


@pytest.mark.parametrize(("speed", "lasts"), [(2.0, True), (30.0, False)])
def test_slip_ends_when_quiet(speed: float, lasts: bool) -> None:
    """A single sample keeps it up, but no outlier: 30 thresholds are more than a slip gains within 19 ms."""
    e = estimate(slip_count=3)
    carry(e, 0, 0.5)
    for stamp_ms, now, slips in (
        (10, 2.0, False), (15, 2.0, False), (20, 2.0, True), (21, 0.0, True), (39, 0.0, True), (40, speed, True),
        (69, 0.0, True), (70, 0.0, lasts), (89, 0.0, lasts), (90, 0.0, False), (91, 0.0, False),
    ):  # fmt: skip
        sample(e, stamp_ms, now * THRESHOLD)
        assert bool(e.state.slipping) is slips, stamp_ms


@pytest.mark.parametrize(("gap_ms", "slips"), [(1, False), (20, True)])
def test_impossible_speed_is_an_outlier(gap_ms: int, slips: bool) -> None:
    e = estimate(slip_count=3, confirmed=2)
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
    e = estimate(threshold=5e-5, slip_count=1, pre_sliding=1e-5)
    for ms in range(ticks):
        carry(e, ms, 0.5)
        sample(e, ms, speed * (back if ms // 4 % 2 else 1.0))
    assert bool(e.state.slipping) is slips
    assert bool(e.state.F_median < CONFIGURED) is slips


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
    assert np.isclose(e.state.F_median, KEPT * load if slips else CONFIGURED)


def test_brief_gap_is_the_same_slip() -> None:
    e = estimate()
    for ms in range(40):
        carry(e, ms, 0.8 if ms < 20 else 0.4)
    assert sample(e, 10, 2.0 * THRESHOLD)
    assert not sample(e, 25, 0.0)
    assert not sample(e, 30, 2.0 * THRESHOLD), "it slides at that load"
    assert (e.state.F_median, e.history.events) == (KEPT * 0.8, 1)


@pytest.mark.parametrize(("before", "after"), [(0.9, KEPT * 0.8), (0.3, 0.3)])
def test_slip_lowers_what_is_certain(before: float, after: float) -> None:
    e = estimate(Friction.UNKNOWN)
    e.state.F_median, e.state.carried = CONFIGURED, before
    carry(e, 0, 0.8)
    assert sample(e, 10, 2.0 * THRESHOLD)
    assert np.isclose(e.state.carried, after)
    assert e.history.events == 1


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
    state.F_median, state.carried = 2.5, 0.0
    certify(config, state, history, 0)
    assert state.carried == 0.0
    for k, load in enumerate((1.0, 2.0, 1.5, 9.0)):
        history.loads[k].stamp_ns, history.loads[k].commanded, history.count = 10 * MS * (k + 1), load, k + 1
    for now_ms, carried in ((29, 0.0), (30, 1.0), (40, 2.0), (50, 2.0), (60, 2.5)):
        certify(config, state, history, now_ms * MS)
        assert state.carried == carried, now_ms
    state.slipping, state.carried = 1, 0.0
    certify(config, state, history, 60 * MS)
    assert state.carried == 0.0


# -- several pads


@pytest.mark.parametrize(("friction", "F_lo"), [(Friction.KNOWN, 0.8), (Friction.LEARNT, 0.8), (Friction.UNKNOWN, 0.3)])
def test_certain_load(friction: Friction, F_lo: float) -> None:
    e = estimate(friction)
    e.state.F_median, e.state.carried = 0.8, 0.3
    put_certain(e.config, e.state)
    assert e.state.F_lo == F_lo


def test_path_has_the_weakest_friction() -> None:
    pad, both = estimate().state, estimate().state
    both.F_lo, both.F_median, both.carried, both.first = 1.0, 1.0, 0.5, 1.0
    pad.F_lo, pad.F_median, pad.slipped_at, pad.carried, pad.first, pad.slipping = 0.66, 0.7, 0.74, 0.6, 1.0, 1
    take_weaker(both, pad)
    assert (both.F_lo, both.F_median, both.slipped_at, both.carried, both.slipping) == (0.66, 0.7, 0.74, 0.5, 1)


def test_nothing_of_before_remains() -> None:
    config = estimate().config
    found = left(start_friction, config, blank(ContactEstimate), FrictionEvidence, 0.1, 0.0)
    assert (set(found), found["said_ns"], found["last_ns"]) == ({"loads", "said_ns", "last_ns"}, NEVER, NEVER)
    found = left(start_friction, config, ContactEstimate, blank(FrictionEvidence), 0.1, 0.0)
    assert not {"slipped_at", "slipping"} & set(found)
