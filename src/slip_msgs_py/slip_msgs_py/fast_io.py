"""Sending a tick's messages as bytes, and receiving: good messages become samples, others are refused and counted.

rclpy's typed code takes 10 us to build a message and 12 us to serialise it; numbers put into bytes that it has written
once take 4. What is received is read with the typed code, 27 us a joint state.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.subscription import Subscription
from rosidl_parser.definition import AbstractNestedType, AbstractString, AbstractType, Array, NamespacedType

from slip_core.errors import InputError
from slip_core.stamps import split_ns
from slip_core.topics import topic
from slip_msgs_py.messages.to_msgs import Form
from slip_msgs_py.qos import NodeLike, create_publisher, create_subscription, message_class

Sample = TypeVar("Sample")
_STAMP: Final = struct.Struct("<iI")
_PROBE_NS: Final = 12_345_678_901_234_567
_HEADER: Final = 4
"""Bytes before the first field of a message in CDR."""
_SIZES: Final = {"double": 8, "int64": 8, "int32": 4, "uint32": 4}
"""Bytes of each type of number in a form."""
_PROBE: Final = 1 << 40  # numbers and stamp that stand nowhere else in a message


class _Layout(NamedTuple):
    """A message in CDR, and where its stamp and its numbers lie."""

    data: bytes
    stamp_at: int
    starts: list[int]


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
        self._dtype = np.dtype(form.dtype)
        self._layouts: dict[tuple[int, ...], _Layout] = {}

    def _lay_out(self, sizes: tuple[int, ...]) -> _Layout:
        """Let rclpy write numbers that occur nowhere else in the message, and find them."""
        numbers = itertools.count(_PROBE)
        probes = [np.array([next(numbers) for _ in range(size)], self._dtype) for size in sizes]
        data = serialized(self._form.message(_PROBE_NS, *probes))
        stamp_at = data.find(_STAMP.pack(*split_ns(_PROBE_NS)))  # -1 where the form has none
        return _Layout(data, stamp_at, [data.index(probe.tobytes()) for probe in probes])

    def encode(self, stamp_ns: int, *numbers: Sequence[float] | NDArray[Any]) -> bytes:
        """Return the message's bytes; one array of numbers per field of the form."""
        arrays = [np.asarray(values, self._dtype) for values in numbers]
        sizes = tuple(map(len, arrays))
        layout = self._layouts.get(sizes) or self._layouts.setdefault(sizes, self._lay_out(sizes))
        data = bytearray(layout.data)
        if self._form.stamp:
            _STAMP.pack_into(data, layout.stamp_at, *split_ns(stamp_ns))
        for start, values in zip(layout.starts, arrays, strict=True):
            data[start : start + values.nbytes] = values.tobytes()
        return bytes(data)

    def send(self, stamp_ns: int, *numbers: Sequence[float] | NDArray[Any]) -> None:
        """Publish; one array of numbers per field of the form."""
        self._publish(self.encode(stamp_ns, *numbers))


def serialized(message: Any) -> bytes:
    """Return a message in CDR, zeros where bytes align its fields; rclpy leaves there and behind it what memory had."""
    data = bytearray(serialize_message(message))

    def align(at: int, size: int) -> int:
        start = at + -at % size
        data[_HEADER + at : _HEADER + start] = bytes(start - at)
        return start

    def end(at: int, value: Any, kind: AbstractType) -> int:
        if isinstance(kind, NamespacedType):
            for name, slot in zip(value.get_fields_and_field_types(), value.SLOT_TYPES, strict=True):
                at = end(at, getattr(value, name), slot)
            return at
        if isinstance(kind, AbstractNestedType):
            at = at if isinstance(kind, Array) else align(at, 4) + 4
            for one in value:
                at = end(at, one, kind.value_type)
            return at
        if isinstance(kind, AbstractString):
            return align(at, 4) + 4 + len(value.encode()) + 1
        size = _SIZES[kind.typename]
        return align(at, size) + size

    return bytes(data[: _HEADER + end(0, message, NamespacedType([], ""))])


def create_sender(node: NodeLike, name: str, form: Form) -> Sender:
    """Create the publisher of a topic of the table and what sends through it."""
    return Sender(create_publisher(node, name), form)


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


LARGEST: Final = 1 << 16
"""Bytes of a message that is taken: one of a megabyte takes half a second to read, in which nothing else happens."""


def typed(data: bytes, kind: type) -> Any:
    """Return the message of a class in these bytes.

    Raises:
        InputError: they are none, or too many.
    """
    if len(data) > LARGEST:
        raise InputError("message", got=f"{len(data)} bytes", expected=f"at most {LARGEST}")
    try:
        return deserialize_message(data, kind)
    except RuntimeError:
        name = kind.__name__
        raise InputError("message", got=f"{len(data)} bytes that are no {name}", expected=name) from None


def create_receiver(
    node: NodeLike,
    name: str,
    read: Callable[[Any], Sample],
    deliver: Callable[[Sample], None],
    refusals: Refusals,
    *,
    depth: int,
    reliable: bool,
) -> Subscription:
    """Subscribe to a topic of the table: good messages are delivered as samples, others counted as refused.

    read: makes a sample of a message; raises InputError where it is not acceptable. Messages are taken as bytes, so
    that bytes that are not a message are counted too: rclpy drops them silently.
    """
    kind = message_class(topic(name).type)

    def take(data: bytes) -> None:
        try:
            sample = read(typed(data, kind))
        except InputError as error:
            refusals.add(name, error)
        else:
            deliver(sample)

    return create_subscription(node, name, take, depth=depth, reliable=reliable, raw=True)
