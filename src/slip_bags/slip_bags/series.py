"""Columns of decoded values: all messages of one topic as numpy arrays.

Whole columns are cut out of many messages at once: about 1 us per message beyond reading its bytes. The decoder of
`mcap_ros2` takes 10 to 18 us (joint states and wrenches of a recorded run).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slip_core.errors import InputError
from slip_msgs_py.messages.layout import Layout, Leaf, Schema, Text

if TYPE_CHECKING:
    from slip_bags.reader import RawMessage

Ints = NDArray[np.int64]


class Series(Mapping[str, NDArray[Any]]):
    """All messages of a topic, one array per field, in order of log time; read-only.

    A field is named by its path (``wrench.force.x``, ``points[0].positions``). A plain field is an array (n,), an
    array field (n, k); where k differs between messages it is an array (n,) of arrays. Text is of dtype object.

    Attributes:
        log_time_ns: receive time of each message; (n,) int64 [ns].
        publish_time_ns: source time; (n,) int64 [ns].
        sequence: the publisher's number of each message, 0 where not recorded; (n,) int64.
        stamp_ns: header stamp; (n,) int64 [ns], None where the type has none.
    """

    def __init__(self, schema: Schema, messages: Iterable[RawMessage]) -> None:
        rows = list(messages)
        self._topic = rows[0].topic if rows else ""
        self.log_time_ns = _ints(row.log_time_ns for row in rows)
        self.publish_time_ns = _ints(row.publish_time_ns for row in rows)
        self.sequence = _ints(row.sequence for row in rows)
        self._columns = _columns(schema, [row.data for row in rows])
        self.stamp_ns = self._stamp()

    def __getitem__(self, field: str) -> NDArray[Any]:
        return self._columns[field]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        """Number of fields, as for every mapping; the number of messages is `count`."""
        return len(self._columns)

    @property
    def count(self) -> int:
        """Number of messages."""
        return len(self.log_time_ns)

    @property
    def stamps(self) -> Ints:
        """The header stamps; (n,) int64 [ns].

        Raises:
            InputError: the type has none.
        """
        if self.stamp_ns is None:
            raise InputError(f"topic {self._topic}", got="messages without a header", expected="stamped messages")
        return self.stamp_ns

    def columns(self, *paths: str) -> NDArray[Any]:
        """Return the components x, y, z and, where there is one, w of some fields as columns; (n, 3 or 4 per field)."""
        names = [f"{path}.{axis}" for path in paths for axis in "xyzw" if axis != "w" or f"{path}.w" in self]
        return np.stack([self[name] for name in names], axis=1)

    def newest(self, times_ns: NDArray[Any]) -> NDArray[np.intp]:
        """Return the number of the newest message at each time by its stamp, -1 before the first one."""
        return np.searchsorted(self.stamps, times_ns, side="right") - 1

    def _stamp(self) -> Ints | None:
        for prefix in ("header.stamp.", "stamp.", "clock."):
            if f"{prefix}sec" in self._columns and f"{prefix}nanosec" in self._columns:
                seconds = self._columns[f"{prefix}sec"].astype(np.int64)
                return _frozen(seconds * 1_000_000_000 + self._columns[f"{prefix}nanosec"].astype(np.int64))
        return None


def _columns(schema: Schema, messages: Sequence[bytes]) -> dict[str, NDArray[Any]]:
    """Group the messages by shape, cut the columns of each group, and put them together in order."""
    groups = _groups(schema, messages)
    parts: dict[str, list[tuple[Ints, NDArray[Any]]]] = {}
    for layout, indexes, matrix in groups:
        for leaf in layout.leaves:
            parts.setdefault(leaf.path, []).append((indexes, _leaf_column(matrix, leaf, layout.little_endian)))
        for text in layout.texts:
            parts.setdefault(text.path, []).append((indexes, _text_column(matrix, text)))
    return {path: _assembled(pieces, len(messages)) for path, pieces in parts.items()}


def _groups(schema: Schema, messages: Sequence[bytes]) -> list[tuple[Layout, Ints, NDArray[np.uint8]]]:
    by_length: dict[int, list[int]] = {}
    for index, data in enumerate(messages):
        by_length.setdefault(len(data), []).append(index)
    groups = []
    for length, members in by_length.items():
        indexes = np.array(members, dtype=np.int64)
        matrix = np.frombuffer(b"".join([messages[index] for index in members]), dtype=np.uint8)
        matrix = matrix.reshape(len(members), length)
        while len(indexes):
            layout = schema.layout(matrix[0].tobytes())
            same = _same_shape(matrix, layout)
            groups.append((layout, indexes[same], matrix[same]))
            indexes, matrix = indexes[~same], matrix[~same]
    return groups


def _same_shape(matrix: NDArray[np.uint8], layout: Layout) -> NDArray[np.bool_]:
    """Which rows have the same byte order and the same size words as the layout; the first always has."""
    same = matrix[:, 1] == matrix[0, 1]
    for offset, _ in layout.sizes:
        same &= (matrix[:, offset : offset + 4] == matrix[0, offset : offset + 4]).all(axis=1)
    return same


def _leaf_column(matrix: NDArray[np.uint8], leaf: Leaf, little_endian: bool) -> NDArray[Any]:
    dtype = np.dtype(leaf.dtype).newbyteorder("<" if little_endian else ">")
    count = 1 if leaf.count is None else leaf.count
    raw = np.ascontiguousarray(matrix[:, leaf.offset : leaf.offset + count * dtype.itemsize])
    if dtype == np.bool_:
        raw = (raw != 0).view(np.uint8)
    values = raw.view(dtype).reshape(len(matrix), count) if count else np.empty((len(matrix), 0), dtype)
    values = values.astype(dtype.newbyteorder("="), copy=False)
    return values[:, 0] if leaf.count is None else values


def _text_column(matrix: NDArray[np.uint8], text: Text) -> NDArray[Any]:
    column = np.empty((len(matrix), len(text.places)), dtype=object)
    for position, (offset, length) in enumerate(text.places):
        cells = np.ascontiguousarray(matrix[:, offset : offset + length])
        if (cells == cells[0]).all():
            column[:, position] = _decode(cells[0])
        else:
            column[:, position] = [_decode(cell) for cell in cells]
    return column if text.is_array else column[:, 0]


def _decode(cell: NDArray[np.uint8]) -> str:
    return cell.tobytes().decode("utf-8", "replace")


def _assembled(pieces: list[tuple[Ints, NDArray[Any]]], count: int) -> NDArray[Any]:
    if len(pieces) == 1 and len(pieces[0][0]) == count:
        return _frozen(pieces[0][1])
    shapes = {piece.shape[1:] for _, piece in pieces}
    if len(shapes) == 1 and sum(len(indexes) for indexes, _ in pieces) == count:
        whole = np.empty((count, *shapes.pop()), dtype=pieces[0][1].dtype)
        for indexes, piece in pieces:
            whole[indexes] = piece
        return _frozen(whole)
    ragged = np.empty(count, dtype=object)  # None where a message has no such element
    for indexes, piece in pieces:
        for index, row in zip(indexes, piece, strict=True):
            ragged[index] = row
    return _frozen(ragged)


def _ints(values: Iterable[int]) -> Ints:
    return _frozen(np.fromiter(values, dtype=np.int64))


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    array.setflags(write=False)
    return array
