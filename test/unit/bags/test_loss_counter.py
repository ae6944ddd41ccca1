"""Counting losses from a publisher's numbers."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_bags.recording.loss_counter import LossCounter


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


@pytest.mark.parametrize(("numbers", "publishers"), [((1, 2), 2), ((0, 0), 1)], ids=["two at once", "no numbers"])
def test_unknowable(numbers, publishers):
    counter = count(*numbers)
    counter.see_publishers(publishers)
    assert (counter.lost, counter.received) == (None, 2)


def test_nothing_came():
    assert count().lost == 0
