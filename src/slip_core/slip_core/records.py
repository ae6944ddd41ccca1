"""Records: an annotated class is the one declaration of a layout, for mypy, Python, compiled code, bags and topics.

    class Gains(Record):
        K_D: Vec6  # N/m, N m/rad
        alpha: Real  # s/m


    GAINS = dtype_of(Gains)

Numbers lie in flat float64 buffers; `gains: Gains = record(buffer, GAINS)` reads and writes them by name. Every field
is 8 bytes (Real, Whole), an array of them, another record, or an array of records, so that a buffer's bytes are the
record's. The compiler types a record by its dtype: annotations cost nothing there.
"""

from __future__ import annotations

import functools
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_core.arrays import Array
from slip_core.stamps import seconds_to_ns

REAL, WHOLE = "f8", "i8"

Real = Annotated[float, REAL]
Whole = Annotated[int, WHOLE]
WholeArray = NDArray[np.int64]
Vec3 = Annotated[Array, 3]
Vec6 = Annotated[Array, 6]
Mat3 = Annotated[Array, (3, 3)]
"""Fields that are arrays: the shape follows the type. Others: Annotated[Array, 7], Annotated[WholeArray, 7]."""


Records = list
"""A field that is an array of records: `Annotated[Records[Slip], 4]`."""


class Record:
    """Base of declared records. It has no instances: a record is a view of a buffer, which `record` returns."""


class View(np.void):  # type: ignore[misc]  # numpy says final, and has np.record
    """A record in Python: numpy's own, with fields as attributes. np.record has them too, four times as slow."""

    __slots__ = ()

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except ValueError:
            raise AttributeError(f"the record has no field {name}") from None

    def __setattr__(self, name: str, value: ArrayLike) -> None:
        self[name] = value


@functools.cache  # a record is part of many others: their hints are evaluated once
def dtype_of(declared: type[Record]) -> np.dtype[np.void]:
    """Return the dtype of a declared record, fields in the order of the class.

    Raises:
        TypeError: a field that is no number, array or record.
    """
    hints = get_type_hints(declared, include_extras=True)
    return layout([(name, *_field(f"{declared.__name__}.{name}", hint)) for name, hint in hints.items()])


def layout(fields: list[Any]) -> np.dtype[np.void]:
    """Return the dtype of a record from its fields: name, type and, of an array, shape, as numpy wants them."""
    return np.dtype((View, fields))


def _field(name: str, hint: object) -> tuple[Any, ...]:
    """Return type and, of an array, shape of a field, as numpy wants them."""
    if isinstance(hint, type) and issubclass(hint, Record):
        return (dtype_of(hint),)  # type: ignore[arg-type]  # every class is hashable
    kind, *given = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    if given in ([REAL], [WHOLE]):
        return (given[0],)
    if len(given) == 1 and get_origin(kind) is Records:
        return (dtype_of(get_args(kind)[0]), given[0])
    if len(given) == 1 and kind in (Array, WholeArray):
        return (REAL if kind == Array else WHOLE, given[0])
    raise TypeError(f"{name}: {hint} is no Real, Whole, Annotated array or Record")


def new(dtype: np.dtype[np.void]) -> Array:
    """Return a buffer of zeros for a layout."""
    return np.zeros(dtype.itemsize // 8)


def record(buffer: Array, dtype: np.dtype[np.void]) -> Any:
    """Return the view of a buffer by name.

    Args:
        buffer: float64, as `new` makes it.
        dtype: its layout; in compiled code a module's constant.
    """
    return np.ndarray(1, dtype, buffer)[0]  # `view` looks at every field of a layout first: 0.3 us instead of up to 43


def copy_fields(to: Any, *sources: object) -> None:
    """Copy numbers, and arrays of them, into those fields of a record whose names they have in one of the sources.

    A field in whole nanoseconds, `age_ns`, is that of the seconds `age_s`. A shorter array fills the first places.
    """
    for name in to.dtype.names:
        in_seconds = name.removesuffix("ns") + "s" if name.endswith("_ns") else name
        for value in (getattr(source, in_seconds) for source in sources if hasattr(source, in_seconds)):
            if isinstance(value, tuple):
                to[name][: len(value)] = value
            elif isinstance(value, int | float):
                to[name] = value if in_seconds == name else seconds_to_ns(value)


def records(matrix: Array, dtype: np.dtype[np.void]) -> Any:
    """Return the view of a matrix (n, size of the layout) as n records, one per row.

    Args:
        matrix: float64, by rows.
        dtype: layout of a row; in compiled code a module's constant.
    """
    return np.ndarray(matrix.nbytes // dtype.itemsize, dtype, matrix)


def place(dtype: np.dtype[np.void], path: str) -> slice:
    """Return where a field lies in a buffer, for reading it without a view by name.

    Args:
        dtype: the layout.
        path: names, with dots between those of nested layouts.
    """
    start = 0
    for name in path.split("."):
        dtype, offset = dtype.fields[name][:2]  # type: ignore[index]
        start += offset // 8
    return slice(start, start + dtype.itemsize // 8)


class Pose(Record):
    """Where something is, as seen from something else."""

    position: Vec3  # m
    rotation: Mat3


POSE = dtype_of(Pose)
