"""Taking messages, and counting losses from a publisher's numbers."""

from __future__ import annotations

import contextlib
from types import SimpleNamespace

from hypothesis import given
from hypothesis import strategies as st
from std_msgs.msg import String

from slip_bags.recorder import RawSubscription
from slip_msgs_py.qos import profile


class Reader(contextlib.nullcontext):
    """A reader as rclpy hands it out: in the order of sending, (number, time it was received at) each."""

    def __init__(self, rows: list[tuple[int, int]]) -> None:
        super().__init__()
        self._left = list(rows)

    def take_message(self, _class, _raw):
        if not self._left:
            return None
        number, received_ns = self._left.pop(0)
        times = {"received_timestamp": received_ns, "source_timestamp": number, "publication_sequence_number": number}
        return b"", times


def subscription(rows: list[tuple[int, int]]) -> RawSubscription:
    node = SimpleNamespace(create_subscription=lambda *_, **__: SimpleNamespace(handle=Reader(rows)))
    return RawSubscription(node, String, "/x", profile(10, reliable=True, latched=False))


def lost(*numbers: int, publishers: int = 1) -> int:
    source = subscription([(number, number) for number in numbers])
    source.publishers = publishers
    assert len(list(source.drain())) == len(numbers)
    return source.lost


@given(st.sets(st.integers(1, 60), min_size=1), st.sets(st.integers(1, 60), min_size=1))
def test_two_publishers_in_succession(first, second):
    """The gaps between the first and the last that came of each are lost."""
    if max(first) >= min(second):  # else the second continues the first's numbers: one publisher, as far as one can see
        gaps = max(first) - min(first) + 1 - len(first) + max(second) - min(second) + 1 - len(second)
        assert lost(*sorted(first), *sorted(second)) == gaps


def test_what_cannot_be_known_is_not_counted():
    """Of a middleware that does not number, and of two publishers at once."""
    assert lost(0, 0) == lost() == lost(1, 5, 2, 6, publishers=2) == 0


def test_messages_behind_one_that_was_sent_again_come_no_earlier():
    """A subscription that was matched late asks for number 1 when 2 and 3 have come: a bag is read in order of time."""
    arrivals = list(subscription([(1, 50), (2, 20), (3, 30), (4, 60)]).drain())
    assert [arrival.log_time_ns for arrival in arrivals] == [50, 50, 50, 60]
    assert [arrival.sequence for arrival in arrivals] == [1, 2, 3, 4]
