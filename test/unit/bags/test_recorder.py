"""Taking messages, and counting losses from a publisher's numbers."""

from __future__ import annotations

import contextlib
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st
from std_msgs.msg import String

from slip_bags.recorder import LossCounter, RawSubscription
from slip_msgs_py.qos import profile


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


class Reader(contextlib.nullcontext):
    """A reader as rclpy hands it out: in the order of sending, each with the time it was received at."""

    def __init__(self, received_ns: list[int]) -> None:
        super().__init__()
        self._left = list(enumerate(received_ns, start=1))

    def take_message(self, _class, _raw):
        if not self._left:
            return None
        number, received_ns = self._left.pop(0)
        times = {"received_timestamp": received_ns, "source_timestamp": number, "publication_sequence_number": number}
        return b"", times


def test_messages_behind_one_that_was_sent_again_come_no_earlier():
    """A subscription that was matched late asks for number 1 when 2 and 3 have come: a bag is read in order of time."""
    node = SimpleNamespace(create_subscription=lambda *_, **__: SimpleNamespace(handle=Reader([50, 20, 30, 60])))
    source = RawSubscription(node, String, "/x", profile(10, reliable=True, latched=False))
    arrivals = list(source.drain())
    assert [arrival.log_time_ns for arrival in arrivals] == [50, 50, 50, 60]
    assert [arrival.sequence for arrival in arrivals] == [1, 2, 3, 4]
