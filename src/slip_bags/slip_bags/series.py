"""Columns of decoded values: all messages of one topic as numpy arrays, or as a pandas table."""

from __future__ import annotations

import contextlib
import functools
import itertools
from collections.abc import Iterable, Iterator
from operator import attrgetter
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from slip_core.errors import InputError, UnknownName
from slip_core.stamps import NS_PER_S

if TYPE_CHECKING:
    import pandas as pd

    from slip_bags.format import BagMessage


_AT_ONCE = 4096
"""Messages that are in memory as objects at once: arrays take a fraction."""


class Series(dict[str, NDArray[Any]]):
    """All messages of a topic, one read-only array per field, in order of log time.

    A field is named by its path (``wrench.force.x``). A plain field is an array (n,), a field of numbers (n, k); where
    k differs between messages, and of texts and messages, it is an array (n,) of arrays or lists.

    Attributes:
        topic: its name.
        log_time_ns: receive time of each message; (n,) int64 [ns].
        publish_time_ns: source time; (n,) int64 [ns].
        sequence: the publisher's number of each message, 0 where not recorded; (n,) int64.

    Raises:
        InputError: a field that the type does not have.
    """

    def __init__(self, topic: str, messages: Iterable[BagMessage]) -> None:
        self.topic = topic
        times, parts = [np.empty((0, 3), dtype=np.int64)], list[list[NDArray[Any]]]()
        fields: dict[str, attrgetter[Any]] = {}
        known: dict[tuple[str, ...], list[str]] = {}  # names and the like, which seldom change, are kept once
        left = iter(messages)
        while some := list(itertools.islice(left, _AT_ONCE)):
            fields = fields or {path: attrgetter(path) for path in _paths(some[0].value)}
            rows = [[_cell(field(one.value)) for field in fields.values()] for one in some]
            for row in rows:
                for place, cell in enumerate(row):
                    if isinstance(cell, list) and cell and isinstance(cell[0], str):
                        row[place] = known.setdefault(tuple(cell), cell)
            times.append(np.array([one[1:4] for one in some], dtype=np.int64))
            parts.append([_column(cells) for cells in zip(*rows, strict=True)])
        table = np.concatenate(times)
        order = np.argsort(table[:, 0], kind="stable")
        self.log_time_ns, self.publish_time_ns, self.sequence = _frozen(table[order]).T
        columns = zip(*parts, strict=True)
        super().__init__({path: _frozen(_joined(column)[order]) for path, column in zip(fields, columns, strict=True)})

    def __missing__(self, path: str) -> NDArray[Any]:
        raise UnknownName("field", path, self, where=f"topic {self.topic}")

    @functools.cached_property
    def stamps(self) -> NDArray[np.int64]:
        """The header stamps; (n,) int64 [ns].

        Raises:
            InputError: the type has none.
        """
        for prefix in ("header.stamp.", "stamp.", "clock."):
            if f"{prefix}sec" in self:
                seconds = self[f"{prefix}sec"].astype(np.int64)
                return _frozen(seconds * NS_PER_S + self[f"{prefix}nanosec"].astype(np.int64))
        raise InputError(f"topic {self.topic}", got="messages without a header", expected="stamped messages")

    def columns(self, *paths: str) -> NDArray[Any]:
        """Return the components x, y, z and, where there is one, w of some fields as columns; (n, 3 or 4 per field)."""
        names = [f"{path}.{axis}" for path in paths for axis in "xyzw" if axis != "w" or f"{path}.w" in self]
        return np.stack([self[name] for name in names], axis=1)

    def dataframe(self) -> pd.DataFrame:
        """Return a table with one column per number: times, sequence and stamp first, then every field.

        A field of numbers becomes one column per element, ``position[0]``; where its length varies, and of texts and
        messages, its cells are arrays and lists.
        """
        import pandas as pd  # takes a good part of a second to load

        columns = {name: getattr(self, name) for name in ("log_time_ns", "publish_time_ns", "sequence")}
        with contextlib.suppress(InputError):
            columns["stamp_ns"] = self.stamps
        for field, values in self.items():
            if values.ndim == 2:
                columns |= {f"{field}[{index}]": column for index, column in enumerate(values.T)}
            else:
                columns[field] = values
        return pd.DataFrame(columns)


def _paths(value: Any, prefix: str = "") -> Iterator[str]:
    """Yield the paths of all numbers, texts and arrays of a decoded message."""
    for name in value.__slots__:
        item = getattr(value, name)
        if isinstance(item, SimpleNamespace):
            yield from _paths(item, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}"


def _cell(value: Any) -> Any:
    """Return a field of one message, numbers as an array; texts and messages stay a list."""
    if isinstance(value, bytes):
        return np.frombuffer(value, dtype=np.uint8)
    is_numbers = isinstance(value, list) and not (value and isinstance(value[0], str | SimpleNamespace))
    return np.array(value) if is_numbers else value


def _column(cells: tuple[Any, ...]) -> NDArray[Any]:
    """Put the cells of one field together: (n,), or (n, k) where all are arrays of one length."""
    shapes = {cell.shape if isinstance(cell, np.ndarray) else None for cell in cells}
    if len(shapes) == 1 and not isinstance(cells[0], str | list):
        return np.array(cells)
    column = np.empty(len(cells), dtype=object)
    for index, cell in enumerate(cells):
        column[index] = cell
    return column


def _joined(parts: tuple[NDArray[Any], ...]) -> NDArray[Any]:
    """Put the columns of one field in parts together, as `_column` does."""
    same = len({part.shape[1:] for part in parts}) == 1
    return np.concatenate(parts) if same else _column(tuple(cell for part in parts for cell in part))


def _frozen(array: NDArray[Any]) -> NDArray[Any]:
    array.setflags(write=False)
    return array
