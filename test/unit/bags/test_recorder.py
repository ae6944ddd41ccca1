"""Counting losses from a publisher's numbers."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from slip_bags.recorder import LossCounter


def count(*numbers: int) -> LossCounter:
    counter = LossCounter()
    for number in numbers:
        counter.add(number)
    return counter


@given(st.sets(st.integers(1, 60), min_size=1), st.sets(st.integers(1, 60), min_size=1))
def test_two_publishers_in_succession(first, second):
    """The gaps between the first and the last that came of each are lost."""
    counter = count(*sorted(first), *sorted(second))
    if max(first) >= min(second):  # else the second continues the first's numbers: one publisher, as far as one can see
        assert counter.lost == max(first) - min(first) + 1 - len(first) + max(second) - min(second) + 1 - len(second)
    assert counter.received == len(first) + len(second)


def test_unknowable():
    """Of a middleware that does not number."""
    counter = count(0, 0)
    assert (counter.lost, counter.received) == (None, 2)


def test_nothing_came():
    assert count().lost == 0
