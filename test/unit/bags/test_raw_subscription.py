"""Taking messages: those that wait for one that was sent again keep their order in time."""

from __future__ import annotations

import contextlib
from types import SimpleNamespace

from std_msgs.msg import String

from slip_bags.raw_subscription import RawSubscription
from slip_msgs_py.qos import profile


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
    assert [arrival.received_ns for arrival in arrivals] == [50, 50, 50, 60]
    assert [arrival.sequence for arrival in arrivals] == [1, 2, 3, 4]
