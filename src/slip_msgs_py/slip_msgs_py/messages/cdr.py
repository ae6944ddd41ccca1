"""Fast CDR for messages whose form does not change from one to the next: numbers and a stamp in a fixed place.

A typed template is laid out once. After that a message is written by putting numbers into a copy
of the template's bytes, and read only where every other byte (lengths, names, frame ids) equals the template's.
Typed messages cost 10 us to build, 12 us to serialise and 27 us to read; this needs 4 and 2.3 us.
Nothing here knows a message type by name; a codec proves itself against rclpy's own typed code when it is made.
"""

from __future__ import annotations

import re
import struct
from array import array
from collections.abc import Iterable, Iterator, Sequence
from operator import attrgetter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message

from slip_core.stamps import NS_PER_S
from slip_msgs_py.messages.layout import HEADER_BYTES, Layout, Leaf, layout_of

_KINDS: Final = {"double": "d", "int64": "q"}
_DTYPES: Final = {"d": np.dtype("<f8"), "q": np.dtype("<i8")}
_STAMP: Final = struct.Struct("<iI")
_frombuffer, asarray = np.frombuffer, np.asarray
Numbers = NDArray[Any]  # float64 or int64


def laid_out(message: object) -> tuple[bytes, Layout]:
    """Return a typed message in CDR, with zeros as padding, and where its fields lie."""
    layout = layout_of(message)
    template = bytearray(serialize_message(message)[: layout.length])
    for at in layout.padding:
        template[at] = 0
    return bytes(template), layout


def block_under(layout: Layout, path: str) -> Leaf:
    """Return all numbers at `path` and below it as one leaf, its kind a letter of `struct`.

    Raises:
        ValueError: where they are none, of several kinds, not side by side, or neither float64 nor int64.
    """
    found = [leaf for leaf in layout.leaves if re.match(rf"{re.escape(path)}([.\[]|$)", leaf.path)]
    if not found:
        raise ValueError(f"{path}: not numbers")
    first, total = found[0], sum(leaf.count for leaf in found)
    side_by_side = found[-1].offset + 8 * found[-1].count == first.offset + 8 * total
    if first.kind not in _KINDS or any(leaf.kind != first.kind for leaf in found) or not side_by_side:
        raise ValueError(f"{path}: its numbers are not one block of float64 or int64")
    return Leaf(path, _KINDS[first.kind], first.offset, total)


class CdrCodec:
    """Writes and reads messages that differ from a template in a stamp and in some arrays of numbers only.

    Args:
        template: a typed message with the names, lengths and frame ids that all messages share.
        fields: paths of the float64 or int64 numbers that vary (``position``, ``wrench``, ``pose.pose``), in the
            order in which they lie in the message.
        stamp: path of the builtin_interfaces/Time that varies; empty where the message has none.

    Raises:
        ValueError: a path that is not there, or a layout that rclpy's typed code does not agree with.
    """

    def __init__(self, template: object, fields: Sequence[str], stamp: str = "header.stamp") -> None:
        data, layout = laid_out(template)
        self._template = data
        self.size = len(data)
        self._blocks = [block_under(layout, path) for path in fields]
        self._stamp_at = _stamp_offset(layout, stamp) if stamp else None
        spans = [(block.offset, 8 * block.count) for block in self._blocks if block.count]
        if self._stamp_at is not None:
            spans.insert(0, (self._stamp_at, _STAMP.size))
        if spans != sorted(spans):
            raise ValueError(f"{', '.join(fields)}: not in the order of the message")
        self._fixed = _pieces(data, spans)
        self._mask = bytearray(b"\xff" * self.size)
        padding = layout.padding
        for at in (*padding, *(at for start, length in spans for at in range(start, start + length))):
            self._mask[at] = 0
        self._masked = _masked(data, self._mask)
        self._starts = [
            (_DTYPES[block.kind], block.count, block.offset - HEADER_BYTES if block.count else 0)
            for block in self._blocks
        ]
        self._prove(template, padding)

    def encode(self, stamp_ns: int, *numbers: Sequence[float] | Numbers) -> bytes:
        """Return the message with this stamp [ns] and these numbers, one array of the template's size per field."""
        data = bytearray(self._template)
        if self._stamp_at is not None:
            _STAMP.pack_into(data, self._stamp_at, *divmod(stamp_ns, NS_PER_S))
        for (dtype, count, start), values in zip(self._starts, numbers, strict=True):
            at, raw = start + HEADER_BYTES, asarray(values, dtype).tobytes()
            if len(raw) != 8 * count:
                raise ValueError(f"got {len(raw) // 8} numbers for a field of {count}")
            data[at : at + len(raw)] = raw
        return bytes(data)

    def decode(self, data: bytes) -> tuple[int, list[Numbers]] | None:
        """Return stamp [ns] and arrays (read-only views of the bytes), or None where the message has another form.

        Also where the stamp is none: nanoseconds of a second or more could not be sent back.
        """
        if len(data) != self.size:
            return None
        for start, stop, piece in self._fixed:
            if data[start:stop] != piece and _masked(data, self._mask) != self._masked:
                return None  # more than the padding differs
        stamp_ns = 0
        if self._stamp_at is not None:
            sec, nanosec = _STAMP.unpack_from(data, self._stamp_at)
            if nanosec >= NS_PER_S:
                return None
            stamp_ns = sec * NS_PER_S + nanosec
        body = data[HEADER_BYTES:]  # a copy in which numbers are aligned as CDR aligns them
        return stamp_ns, [_frombuffer(body, dtype, count, start) for dtype, count, start in self._starts]

    def _prove(self, template: object, padding: Sequence[int]) -> None:
        """Write every varying place with a number of its own and have rclpy read and write the same."""
        probes: list[Numbers] = []
        for block in self._blocks:
            probes.append(np.arange(1, block.count + 1, dtype=_DTYPES[block.kind]) * len(block.path) + len(probes))
        stamp_ns = 12_345 * NS_PER_S + 678_901_234
        data = self.encode(stamp_ns, *probes)
        message = deserialize_message(data, type(template))
        again = serialize_message(message)[: self.size]
        differing = [at for at in range(self.size) if again[at] != data[at] and at not in padding]
        read = self.decode(data)
        expected = [numbers_at(message, block.path) for block in self._blocks]
        if differing or read is None or [list(values) for values in read[1]] != expected:
            raise ValueError(f"layout of {type(template).__name__} differs from rclpy's at bytes {differing[:8]}")


def _pieces(data: bytes | bytearray, spans: Sequence[tuple[int, int]]) -> list[tuple[int, int, bytes]]:
    """Return (start, stop, bytes) before, between and after the spans (offset, length)."""
    starts = [0, *(offset + length for offset, length in spans)]
    stops = [*(offset for offset, _ in spans), len(data)]
    return [(start, stop, bytes(data[start:stop])) for start, stop in zip(starts, stops, strict=True)]


def _masked(data: bytes | bytearray, mask: bytes | bytearray) -> int:
    return int.from_bytes(data, "little") & int.from_bytes(mask, "little")


def _stamp_offset(layout: Layout, path: str) -> int:
    sec = next((leaf for leaf in layout.leaves if leaf.path == f"{path}.sec"), None)
    if sec is None:
        raise ValueError(f"{path}: not a stamp")
    return sec.offset


def numbers_at(message: object, path: str) -> list[Any]:
    """Return all numbers at `path` of a typed message, in the order of its fields."""
    return _numbers_of(attrgetter(path)(message))


def _numbers_of(value: Any) -> list[Any]:
    if hasattr(value, "get_fields_and_field_types"):
        return [number for name in value.get_fields_and_field_types() for number in _numbers_of(getattr(value, name))]
    return [value] if isinstance(value, int | float) else list(value)


def put_numbers(message: object, path: str, values: Iterable[Any]) -> None:
    """Write numbers to `path` of a typed message, in the order of its fields; a sequence takes all that are left."""
    owner, _, name = path.rpartition(".")
    _put(attrgetter(owner)(message) if owner else message, name, iter(values))


def _put(owner: Any, name: str, values: Iterator[Any]) -> None:
    old = getattr(owner, name)
    if hasattr(old, "get_fields_and_field_types"):
        for field in old.get_fields_and_field_types():
            _put(old, field, values)
    elif isinstance(old, int | float):
        setattr(owner, name, type(old)(next(values)))
    else:
        setattr(owner, name, array(old.typecode, values))
