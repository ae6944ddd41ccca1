"""The observer that runs against its plain form, on sequences of every kind; and its memory as a value."""

from __future__ import annotations

import random

import numpy as np
import pytest

from slip_core.types import SlipSample
from slip_vic_controller.core.observer import observe
from slip_vic_controller.core.observer_memory import BLOCK, pack_motion
from slip_vic_controller.core.observer_types import Motion
from slip_vic_controller.core.rotation import exp_so3
from slip_vic_controller.core.snapshot import from_text, to_text

from .observer_bench import EQUAL, MS, Bench, config, six

SENSOR = {"slip_sensor__noise_linear": 2e-3, "slip_sensor__noise_angular": 0.05}
EAGER = {  # to end a slip, of any doubt
    "observer__stick_acceleration_std_m_s2": 0.5, "observer__stick_acceleration_std_rad_s2": 10.0,
    "observer__stick_share": 0.999, "observer__stick_speed_std_m_s": 1.0, "observer__stick_speed_std_rad_s": 100.0,
}  # fmt: skip
WALL_CLOCK_NS = 1_763_700_000_123_456_789
AXES = {
    "plane": (True, True, False, False, False, True),
    "all": (True,) * 6,
    "one": (False, False, True, False, False, False),
    "turning": (False, False, False, True, True, False),
    "none": (False,) * 6,
}


# Attitudes whose products are exact: what differs is the observer alone, not the rounding of its inputs, which a filter
# that has learnt a lot amplifies. Other attitudes: `test_a_tick_is_the_same_in_both_forms`.
TURNED = np.array(((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))), np.eye(3)


class Ride:
    """A pad that sticks, slips and sticks again on a turning hand, with wrong forces and a sensor that can be anything.

    seen: which hypotheses held; arrivals: samples by the tick at which they come.
    """

    def __init__(self, bench: Bench, seed: int, *, rate: float = 0.5, lateness: int = 0, valid: float = 1.0) -> None:
        self.bench, self.rng, self.mix = bench, np.random.default_rng(seed), random.Random(seed)
        self.rate, self.lateness, self.valid = rate, lateness, valid
        self.slip, self.twist = np.zeros(6), np.zeros(6)
        self.stamp_ns = bench.start_ns
        self.arrivals: dict[int, list[SlipSample]] = {}
        self.seen: list[bool] = []

    def go(self, ticks: int, slip_acceleration: np.ndarray | float, noise: float = 1.0) -> None:
        """Go on for some ticks; slip_acceleration (6,) {ee}, or a factor by which slip fades."""
        rng = self.rng
        for _ in range(ticks):
            dt_ns = int(rng.integers(700_000, 1_300_000)) if rng.random() < 0.97 else int(rng.integers(0, 2)) * 9 * MS
            dt, k = 1e-9 * dt_ns, len(self.seen)
            self.stamp_ns += dt_ns
            R = TURNED[k // 40 % 2]
            before = self.slip
            self.slip = (
                before * slip_acceleration if np.isscalar(slip_acceleration) else before + dt * slip_acceleration
            )
            follow = np.array((0.3, -0.1, 0.2, 0.1, 0.0, -0.3)) + 0.02 * rng.standard_normal(6)
            step = dt * follow + (np.kron(np.eye(2), R) @ (self.slip - before)) + 1e-6 * rng.standard_normal(6)
            self.twist = self.twist + step
            reported = 1.1 * follow + 0.03
            drag = R @ (self.slip[:3] * 2.0 + 0.05 * rng.standard_normal(3))
            motion = Motion(self.stamp_ns, R, self.twist, reported, reported, drag, 0.3 * rng.standard_normal(3))
            for _ in range(rng.poisson(self.rate)):
                self._measure(k, dt_ns, noise)
            coming = self.arrivals.pop(k, [])
            self.mix.shuffle(coming)
            self.seen.append(self.bench.move(motion, coming).sliding)

    def _measure(self, k: int, dt_ns: int, noise: float) -> None:
        rng = self.rng
        stamp_ns = self.stamp_ns - int(rng.integers(0, dt_ns + 1)) + (MS if rng.random() < 0.02 else 0)
        deviation = np.array((2e-3, 2e-3, 2e-3, 0.05, 0.05, 0.05))
        twist = self.slip + noise * deviation * rng.standard_normal(6)
        if noise == 1.0 and rng.random() < 0.02:
            twist = twist + 1.0  # an outlier
        if rng.random() < 0.1:
            twist[:3] = 0.0  # the dead band
        valid = bool(rng.random() < self.valid)
        sample = SlipSample(stamp_ns, twist if valid else np.full(6, np.nan), valid)
        self.arrivals.setdefault(k + int(rng.integers(0, self.lateness + 1)), []).append(sample)


def stick_slip_stick(ride: Ride, direction: np.ndarray) -> None:
    ride.go(70, 1.0)
    for turn in (1.0, -1.0):
        ride.go(60, turn * direction)
        ride.go(60, 1.0)
        ride.go(60, 0.85)
        ride.slip = np.zeros(6)
        ride.go(300, 1.0, noise=0.05)


SLIDE = np.array((0.5, -0.3, 0.4, 2.0, -1.5, 3.0))
SENSORS = {
    "on time": {},
    "late": {"lateness": 30},
    "very late": {"lateness": 120},
    "many": {"rate": 4.0, "lateness": 10},
    "rare": {"rate": 0.04, "lateness": 80},
    "none": {"rate": 0.0},
    "half invalid": {"valid": 0.5, "lateness": 5},
}


@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize("sensor", SENSORS)
def test_both_forms_are_equal(axes: str, sensor: str) -> None:
    for seed, band in ((1, 0.0), (2, 2e-3)):
        tuning = config(
            **SENSOR,
            **EAGER,
            contacts__slip_axes=AXES[axes],
            slip_sensor__dead_band_linear=band,
            observer__memory_s=0.1,
        )
        start_ns = WALL_CLOCK_NS if seed == 1 else 0
        ride = Ride(Bench(tuning, start_ns), seed, **SENSORS[sensor])
        stick_slip_stick(ride, SLIDE * AXES[axes])
        if axes != "none":
            assert True in ride.seen, "nothing slipped"
            assert False in ride.seen[ride.seen.index(True) :], "no slip ended"
        if axes == "plane" and sensor == "very late":
            assert ride.bench.state.late > 5, "no sample came too late"


@pytest.mark.parametrize("window_s", [0.001, 0.005])
@pytest.mark.parametrize("memory_s", [1e-4, 0.004, 0.3])
def test_both_forms_are_equal_with_short_memories(window_s: float, memory_s: float) -> None:
    tuning = config(**SENSOR, observer__window_s=window_s, observer__memory_s=memory_s, observer__false_alarm_rate=0.01)
    ride = Ride(Bench(tuning), 3, lateness=6)
    stick_slip_stick(ride, SLIDE)
    assert {True, False} <= set(ride.seen)


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("axes", ["plane", "all", "turning"])
def test_a_tick_is_the_same_in_both_forms(seed: int, axes: str) -> None:
    rng = np.random.default_rng(seed)
    bench = Bench(config(**SENSOR, contacts__slip_axes=AXES[axes]))
    for k in range(2):  # the second one turns from another twist
        R = exp_so3(rng.standard_normal(3))
        bench.plain, _ = observe(bench.config, bench.plain, motion := random_motion(rng, (k + 1) * MS, R), ())
        bench.state = bench.observer.observe(bench.state, motion.stamp_ns, pack_motion(motion), ())
    m, n = bench.plain.history[-1], len(bench.config.axes)
    row = bench.state.rows[-1][-1]
    drag = (*m.drag, *(0.0,) * (3 - len(m.drag)))
    expected = (m.stamp_ns, 0.0, m.dt, *m.turn_linear, *m.turn_angular, *drag, *m.step, *m.force)
    if not bench.state.sliding:
        expected += (*m.steps, *m.impulses, m.time)
    np.testing.assert_allclose(row[: len(expected)], expected, rtol=0.0, atol=EQUAL * np.abs(expected[2:]).max())
    assert len(expected) >= 12 + 2 * n


def random_motion(rng: np.random.Generator, stamp_ns: int, R: np.ndarray) -> Motion:
    six_each = (1e-5 * rng.standard_normal(6), *(1e-2 * rng.standard_normal((2, 6))))
    return Motion(stamp_ns, R, *six_each, rng.standard_normal(3), rng.standard_normal(3))


def test_a_memory_is_a_value() -> None:
    """What came before is not changed by what comes after, and going on from its text gives the same bits."""
    bench = Bench(config(**SENSOR))
    ride = Ride(bench, 5, lateness=40)
    kept = []
    for k in range(260):
        ride.go(1, SLIDE if 80 < k < 120 else 1.0)
        kept.append((bench.state, to_text(bench.state)))
    assert bench.state.sliding
    assert len(bench.state.rows) > 3, "late samples had no older block to go to"
    for memory, text in kept:
        assert to_text(memory) == text
        assert not any(a.flags.writeable for a in (memory.now, *memory.rows))
    restored = from_text(kept[150][1])
    assert to_text(restored) == kept[150][1]
    samples = [SlipSample(bench.start_ns + restored.stamp_ns - 30 * MS, six(x=0.02))]
    motion = np.linspace(-0.1, 0.1, 33)
    after = [bench.observer.observe(m, m.stamp_ns + MS, motion, samples) for m in (kept[150][0], restored)]
    assert to_text(after[0]) == to_text(after[1])
    assert after[0].now.tobytes() == after[1].now.tobytes()


def test_a_long_slip_copies_little_and_forgets_what_is_too_old() -> None:
    bench = Bench(config(**SENSOR, observer__memory_s=0.1, observer__drag_spread=0.0))
    for _ in range(100):
        bench.step(np.zeros(6))
    for _ in range(20):
        bench.step(six(x=1.0))
    for _ in range(1000):
        bench.step(np.zeros(6))
    assert bench.state.sliding
    assert 100 <= sum(map(len, bench.state.rows)) <= 100 + 4 * BLOCK
    assert max(map(len, bench.state.rows)) < 2 * BLOCK


@pytest.mark.parametrize("slipping", [False, True])
def test_numbers_that_are_not_finite_are_refused(slipping: bool) -> None:
    bench = Bench(config(**SENSOR, observer__drag_spread=0.0))
    for k in range(120):
        bench.step(six(x=1.0 if slipping and k >= 100 else 0.0))
    assert bench.state.sliding == slipping
    stamp_ns, motion = bench.state.stamp_ns + MS, np.zeros(33)
    assert bench.observer.observe(bench.state, stamp_ns, motion, ()) is not None
    bad = SlipSample(stamp_ns, six(x=np.nan))
    assert bench.observer.observe(bench.state, stamp_ns, motion, [bad]) is None
    motion[9] = np.inf
    assert bench.observer.observe(bench.state, stamp_ns, motion, ()) is None
