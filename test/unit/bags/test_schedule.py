"""The player's schedule, on a clock of the test's own."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_bags.playing.schedule import SLICE_NS, SPIN_NS, Schedule

SECOND = 10**9
LOOK_NS = 100
ROUNDING_NS = 2  # two roundings to whole nanoseconds


class FakeTime:
    """A clock that only sleeping, and each look at it, moves on."""

    def __init__(self, oversleep_ns: int = 0) -> None:
        self.ns, self.looks = 123 * SECOND, 0
        self.oversleep_ns = oversleep_ns

    def now(self) -> int:
        self.ns, self.looks = self.ns + LOOK_NS, self.looks + 1
        return self.ns

    def sleep(self, seconds: float) -> None:
        self.ns += round(seconds * SECOND) + self.oversleep_ns


def make(rate: float = 1.0, oversleep_ns: int = 0, start_ns: int = 7 * SECOND) -> tuple[Schedule, FakeTime]:
    time = FakeTime(oversleep_ns)
    return Schedule(start_ns, rate, time.now, time.sleep), time


def wait(schedule: Schedule, bag_time_ns: int) -> int:
    slices = 0
    while not schedule.wait(bag_time_ns):
        slices += 1
        assert slices < 10_000
    return slices


@pytest.mark.parametrize("rate", [0.1, 1.0, 3.7, 100.0])
def test_errors_do_not_add_up(rate):
    """Every sleep is too long; the thousandth message is as punctual as the first."""
    schedule, time = make(rate, oversleep_ns=SPIN_NS // 2)
    start = time.ns
    for index in range(1000):
        bag_time = 7 * SECOND + index * SECOND // 1000
        wait(schedule, bag_time)
        late = time.ns - start - (bag_time - 7 * SECOND) / rate
        assert 0 <= late + ROUNDING_NS <= 1000


@pytest.mark.parametrize("ahead_ns", [SPIN_NS // 2, 2 * SPIN_NS, SLICE_NS - SPIN_NS // 2, SLICE_NS + SPIN_NS // 2])
def test_it_sleeps_until_just_before_a_message_is_due(ahead_ns):
    schedule, time = make()
    wait(schedule, 7 * SECOND + ahead_ns)
    assert 0 <= schedule.lateness(7 * SECOND + ahead_ns) <= 10 * LOOK_NS
    assert time.looks < 1.1 * SPIN_NS / LOOK_NS


def test_what_is_due_comes_at_once():
    schedule, time = make()
    time.ns += SECOND
    before = time.ns
    assert schedule.wait(7 * SECOND + 1)
    assert time.ns - before < SPIN_NS


def test_long_waits_are_cut_into_slices():
    schedule, time = make()
    before = time.ns
    assert not schedule.wait(8 * SECOND)
    assert time.ns - before <= SLICE_NS + SPIN_NS


def test_pause_keeps_the_place():
    schedule, time = make()
    wait(schedule, 7 * SECOND + SECOND // 2)
    schedule.pause()
    place = schedule.bag_time()
    for _ in range(100):
        assert not schedule.wait(7 * SECOND)
    assert schedule.bag_time() == place
    schedule.resume()
    before = time.ns
    wait(schedule, place + SECOND)
    assert time.ns - before == pytest.approx(SECOND, abs=SPIN_NS)


@given(first=st.floats(0.1, 10.0), second=st.floats(0.1, 10.0))
def test_rate_changes_without_a_jump(first, second):
    schedule, time = make(first)
    wait(schedule, 8 * SECOND)
    place = schedule.bag_time()
    schedule.set_rate(second)
    assert abs(schedule.bag_time() - place) <= 1000 * (first + second)
    before = time.ns
    wait(schedule, 9 * SECOND)
    assert (time.ns - before) * second == pytest.approx(SECOND, rel=1e-3)


def test_a_restart_while_paused_goes_on_from_there():
    schedule, _ = make()
    schedule.pause()
    schedule.restart(5 * SECOND)
    assert schedule.paused
    assert schedule.bag_time() == 5 * SECOND
    schedule.resume()
    assert schedule.bag_time() == pytest.approx(5 * SECOND, abs=SPIN_NS)


def test_restart_is_due_now():
    schedule, time = make()
    wait(schedule, 9 * SECOND)
    schedule.restart(7 * SECOND)
    before = time.ns
    wait(schedule, 8 * SECOND)
    assert time.ns - before == pytest.approx(SECOND, abs=SPIN_NS)
