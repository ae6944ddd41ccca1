"""Columns of decoded values: all messages of one topic as numpy arrays."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping
from operator import attrgetter
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slip_core.errors import InputError
from slip_core.files.resources import MAX_BYTES

if TYPE_CHECKING:
    from slip_bags.reader import DecodedMessage

_ROW_BYTES = 256  # of the times of a message, and its list
Ints = NDArray[np.int64]


class Series(Mapping[str, NDArray[Any]]):
    """All messages of a topic, one array per field, in order of log time; read-only.

    A field is named by its path (``wrench.force.x``). A plain field is an array (n,), an array field (n, k); where k
    differs between messages it is an array (n,) of arrays. Text and arrays of messages are of dtype object.

    Attributes:
        log_time_ns: receive time of each message; (n,) int64 [ns].
        publish_time_ns: source time; (n,) int64 [ns].
        sequence: the publisher's number of each message, 0 where not recorded; (n,) int64.
        stamp_ns: header stamp; (n,) int64 [ns], None where the type has none.
    """

    def __init__(self, topic: str, messages: Iterable[DecodedMessage]) -> None:
        self._topic = topic
        times: list[tuple[int, ...]] = []
        fields: list[attrgetter[Any]] = []
        rows: list[list[Any]] = []
        paths: list[str] = []
        size = 0
        for *numbers, value in messages:
            if not rows:
                paths = list(_paths(value))
                fields = [attrgetter(path) for path in paths]
            row = [_row(field(value)) for field in fields]
            if rows:  # names and the like, which seldom change, are kept once
                row = [old if _same(old, new) else new for old, new in zip(rows[-1], row, strict=True)]
                size += sum(_size(new) for old, new in zip(rows[-1], row, strict=True) if old is not new)
            size += _ROW_BYTES + 8 * len(row)
            if size > MAX_BYTES:
                raise InputError(f"topic {topic}", got="more messages than memory may hold", expected="a shorter bag")
            times.append(tuple(numbers))
            rows.append(row)
        table = np.array(times, dtype=np.int64).reshape(-1, 3)
        order = np.argsort(table[:, 0], kind="stable")
        table, rows = _frozen(table[order]), [rows[index] for index in order]
        self.log_time_ns, self.publish_time_ns, self.sequence = table.T
        self._columns = {
            path: _frozen(_column(values)) for path, values in zip(paths, zip(*rows, strict=True), strict=True)
        }
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
            if f"{prefix}sec" in self and f"{prefix}nanosec" in self:
                seconds = self[f"{prefix}sec"].astype(np.int64)
                return _frozen(seconds * 1_000_000_000 + self[f"{prefix}nanosec"].astype(np.int64))
        return None


def _paths(value: Any, prefix: str = "") -> Iterator[str]:
    """Yield the paths of all numbers, texts and arrays of a decoded message."""
    for name in value.__slots__:
        item = getattr(value, name)
        if isinstance(item, SimpleNamespace):
            yield from _paths(item, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}"


def _column(values: tuple[Any, ...]) -> NDArray[Any]:
    """Put the values of one field together: (n,), or (n, k) where all are arrays of one length."""
    if isinstance(values[0], str):
        return np.array(values, dtype=object)
    if not isinstance(values[0], list | np.ndarray):
        return np.array(values)
    rows = values
    arrays = [row for row in rows if isinstance(row, np.ndarray)]
    if len(arrays) == len(rows) and len({len(row) for row in arrays}) == 1:
        return np.stack(arrays)
    column = np.empty(len(rows), dtype=object)
    for index, row in enumerate(rows):
        column[index] = row
    return column


def _size(value: Any) -> int:
    """Return about how many bytes a decoded value takes."""
    if isinstance(value, np.ndarray) and value.dtype != object:
        return 112 + value.nbytes
    if isinstance(value, list | np.ndarray):
        return 112 + sum(map(_size, value))
    if isinstance(value, SimpleNamespace):
        return 112 + sum(_size(getattr(value, name)) for name in value.__slots__)
    return sys.getsizeof(value) + 8


def _same(one: Any, other: Any) -> bool:
    """Whether two texts, or arrays of texts, are equal."""
    if isinstance(one, str) or isinstance(other, str):
        return bool(one == other)
    arrays = isinstance(one, np.ndarray) and isinstance(other, np.ndarray) and one.dtype == other.dtype == object
    return arrays and np.array_equal(one, other)


def _row(value: Any) -> Any:
    """Return a field of one message, an array field as an array; an array of messages stays a list."""
    if isinstance(value, bytes):
        return np.frombuffer(value, dtype=np.uint8)
    if not isinstance(value, list) or (value and isinstance(value[0], SimpleNamespace)):
        return value
    return np.array(value, dtype=object if value and isinstance(value[0], str) else None)


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    array.setflags(write=False)
    return array
