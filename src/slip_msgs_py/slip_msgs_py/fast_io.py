"""Sending and receiving a tick's messages as bytes, through codecs that are proved against the typed code.

One code path for lockstep and real time. A sender makes its codec at start. A receiver reads its first message
with the typed decoder, checks it, and from then on takes only the numbers out of messages of the same form; a
message of any other form goes the slow way and is checked again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

from slip_core.errors import InputError
from slip_core.stamps import NS_PER_S
from slip_core.topics import topic
from slip_msgs_py.messages.cdr import CdrCodec, numbers_at
from slip_msgs_py.messages.forms import Form
from slip_msgs_py.qos import NodeLike, create_publisher, create_subscription, message_class

Sample = TypeVar("Sample")
_MOST_FORMS: Final = 16  # forms a receiver learns; a publisher that changes form all the time is read the slow way


class Sender:
    """Publishes one form of message.

    Args:
        publisher: an rclpy publisher.
        form: what its messages look like.
    """

    def __init__(self, publisher: Publisher, form: Form) -> None:
        self.publisher = publisher
        self._publish = publisher.handle.publish_raw  # rclpy's own `publish` adds twice the time of this
        self._form = form
        self._codecs = {form.sizes: self._codec(form.sizes)}

    def _codec(self, sizes: tuple[int, ...]) -> CdrCodec:
        template = self._form.message(0, *([0] * size for size in sizes))
        return CdrCodec(template, self._form.fields, self._form.stamp)

    def encode(self, stamp_ns: int, *numbers: Sequence[float] | NDArray[Any]) -> bytes:
        """Return the message's bytes; one array of numbers per field of the form."""
        sizes = tuple(map(len, numbers))
        if sizes not in self._codecs:  # other sizes than usual, e.g. no effort
            self._codecs[sizes] = self._codec(sizes)
        return self._codecs[sizes].encode(stamp_ns, *numbers)

    def send(self, stamp_ns: int, *numbers: Sequence[float] | NDArray[Any]) -> None:
        """Publish; one array of numbers per field of the form."""
        self._publish(self.encode(stamp_ns, *numbers))


def create_sender(node: NodeLike, name: str, form: Form, *, events: bool = True) -> Sender:
    """Create the publisher of a topic of the table and what sends through it; arguments as in `create_publisher`."""
    return Sender(create_publisher(node, name, events=events), form)


class Receiver(Generic[Sample]):
    """Turns raw messages of one topic into samples.

    Args:
        type_name: ``pkg/msg/Type``.
        fields: paths of the numbers that the sample is made of.
        learn: checks a typed message and returns what makes samples, (stamp_ns, *numbers) -> sample, of all
            messages that differ from it in their numbers only. Raises InputError where it is not acceptable.
        stamp: path of the stamp; empty where the message has none.
    """

    def __init__(
        self,
        type_name: str,
        fields: tuple[str, ...],
        learn: Callable[[Any], Callable[..., Sample]],
        stamp: str = "header.stamp",
    ) -> None:
        self._class = message_class(type_name)
        self._fields, self._stamp, self._learn = fields, stamp, learn
        self._known: dict[int, tuple[CdrCodec, Callable[..., Sample]]] = {}
        self._left = _MOST_FORMS

    def __call__(self, data: bytes) -> Sample:
        """Return the sample of one message.

        Raises:
            InputError: not a message of this type, or one that is not acceptable.
        """
        known = self._known.get(len(data))
        if known is not None:
            codec, make = known
            read = codec.decode(data)
            if read is not None:
                return make(read[0], *read[1])
        return self._slowly(data)

    def _slowly(self, data: bytes) -> Sample:
        try:
            message = deserialize_message(data, self._class)
        except RuntimeError:
            name = self._class.__name__
            raise InputError("message", got=f"{len(data)} bytes that are no {name}", expected=name) from None
        sec, nanosec = numbers_at(message, self._stamp) if self._stamp else (0, 0)
        if nanosec >= NS_PER_S:
            raise InputError("stamp", got=f"{nanosec} nanoseconds", expected="less than a second of them")
        make = self._learn(message)
        if self._left > 0:
            self._left -= 1
            self._known[len(data)] = CdrCodec(message, self._fields, self._stamp), make
        return make(sec * NS_PER_S + nanosec, *(np.array(numbers_at(message, path)) for path in self._fields))


class Refusals:
    """Counts refused messages per topic, and reports each new kind of fault in one line.

    Args:
        report: takes the line.
    """

    def __init__(self, report: Callable[[str], object]) -> None:
        self._report = report
        self._last: dict[str, str] = {}
        self._reported: set[tuple[str, str]] = set()
        self.counts: dict[str, int] = {}

    def add(self, name: str, error: InputError) -> None:
        """Count one refused message of a topic."""
        self.counts[name] = self.counts.get(name, 0) + 1
        self._last[name] = text = str(error)
        kind = name, error.expected  # what was got may differ in every message
        if kind not in self._reported:
            self._reported.add(kind)
            self._report(f"{name}: message refused: {text}")

    def last(self, name: str) -> str:
        """Return the last fault of a topic, an empty text where there was none."""
        return self._last.get(name, "")


def create_receiver(
    node: NodeLike,
    name: str,
    fields: tuple[str, ...],
    learn: Callable[[Any], Callable[..., Sample]],
    deliver: Callable[[Sample], None],
    refusals: Refusals,
    *,
    depth: int,
    reliable: bool,
    stamp: str = "header.stamp",
    actual_name: str | None = None,
) -> Subscription:
    """Subscribe raw to a topic of the table: good messages are delivered as samples, others counted as refused."""
    receiver = Receiver(topic(name).type, fields, learn, stamp)
    shown = actual_name or name

    def take(data: bytes) -> None:
        try:
            sample = receiver(data)
        except InputError as error:
            refusals.add(shown, error)
        else:
            deliver(sample)

    return create_subscription(node, name, take, depth=depth, reliable=reliable, actual_name=actual_name, raw=True)
