"""Counting losses from a publisher's numbers."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_bags.recording.loss_counter import LossCounter
from slip_bags.recording.raw_subscription import Arrival


def count(*numbers_and_times: tuple[int, int]) -> LossCounter:
    counter = LossCounter()
    for sequence, sent_ns in numbers_and_times:
        counter.add(Arrival(sent_ns, sent_ns, sequence, b""))
    return counter


@given(
    st.sets(st.integers(1, 60), min_size=1), st.sets(st.integers(1, 60), min_size=1), st.randoms(use_true_random=False)
)
def test_any_arrivals_of_two_publishers_in_succession(first, second, random):
    """Each in any order: the gaps between the first and the last that came are lost."""
    one = [(number, number) for number in first]
    two = [(number, 1000 + number) for number in second]
    random.shuffle(one)
    counter = count(*one, *sorted(two))
    if max(first) >= min(second):  # else the second continues the first's numbers: one publisher, as far as one can see
        assert counter.lost == max(first) - min(first) + 1 - len(first) + max(second) - min(second) + 1 - len(second)
    assert counter.missed_at_start == min(first) - 1
    assert counter.received == len(first) + len(second)


@pytest.mark.parametrize(
    ("arrivals", "publishers"), [([(1, 1), (2, 2)], 2), ([(0, 1), (0, 2)], 1)], ids=["two at once", "no numbers"]
)
def test_unknowable(arrivals, publishers):
    counter = count(*arrivals)
    counter.see_publishers(publishers)
    assert counter.lost is None
    assert counter.received == 2


def test_nothing_came():
    assert (count().lost, count().missed_at_start) == (0, 0)
