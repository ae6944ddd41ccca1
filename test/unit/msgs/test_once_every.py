"""What is due once a second: at first, then once per period, each with its phase."""

from __future__ import annotations

import pytest

from slip_msgs_py.once_every import OnceEvery

SECOND = 1_000_000_000


def due_times(phase: float, times: range) -> list[int]:
    every = OnceEvery(SECOND, phase)
    return [t for t in times if every.due(t)]


@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5, 0.75])
def test_due_at_first_and_then_once_per_period_at_its_phase(phase: float) -> None:
    begin = 7 * SECOND + 100_000_000
    found = due_times(phase, range(begin, begin + 3 * SECOND, 1_000_000))
    assert found[0] == begin
    after = found[1:]
    assert len(after) == 3
    assert all((t - round(phase * SECOND)) % SECOND == 0 for t in after)


def test_phases_do_not_meet() -> None:
    begin = 5_000_000
    after = [set(due_times(phase, range(begin, 4 * SECOND, 1_000_000))[1:]) for phase in (0.0, 0.25, 0.5, 0.75)]
    assert sum(map(len, after)) == len(set.union(*after))


def test_a_clock_that_is_set_back_is_a_new_period() -> None:
    every = OnceEvery(SECOND, 0.0)
    assert every.due(5 * SECOND)
    assert not every.due(5 * SECOND + 1)
    assert every.due(SECOND)
    assert not every.due(SECOND)
