"""`call(part, ...)`: a part of the control cycle, run as the cycle runs it, from buffers, arrays and numbers."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, Final, get_args, get_origin, get_type_hints

import numpy as np

from slip_core.arrays import Array
from slip_core.records import Record, Records, WholeArray, dtype_of, new, record
from slip_core.vectors import Mat, Spatial, Vec, mat, spatial, vec


def call(part: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a part returns; each argument becomes what the annotation of its parameter asks for.

    A record may be given as its buffer, an array of records as the buffer of all of them, a Vec, Mat or Spatial as an
    array. Arrays, buffers and records that the part writes to are changed. The compiled part is kept like the cycle
    itself, so a second run of the tests compiles nothing.
    """
    function = getattr(part, "py_func", part)
    return part(*[cast(given) for cast, given in zip(_casts(function), arguments, strict=True)])


def blank(kind: type[Record]) -> Any:
    """Return a record of zeros."""
    return record(new(dtype_of(kind)), dtype_of(kind))


def left(part: Callable[..., Any], *arguments: Any) -> dict[str, Any]:
    """Return the fields that are not zero of a record that was full of ones, once a part has begun it.

    In the place of the record stands its class.
    """
    (kind,) = (one for one in arguments if isinstance(one, type))
    buffer = np.ones(new(dtype_of(kind)).size)
    state = record(buffer, dtype_of(kind))
    call(part, *(state if one is kind else one for one in arguments))
    fields = buffer.view(dtype_of(kind))[0]
    return {name: fields[name] for name in fields.dtype.names if any(fields[name].tobytes())}


def flat(result: Any) -> Array:
    """Return a Vec (3,), Mat (3, 3) or Spatial (6,) as an array."""
    return np.array(result, dtype=float).reshape((6,) if isinstance(result, Spatial) else np.shape(result))


@functools.cache
def _casts(function: Callable[..., Any]) -> tuple[Callable[[Any], Any], ...]:
    hints = get_type_hints(function)
    return tuple(_cast(hints[name]) for name in inspect.signature(function).parameters)


def _cast(hint: Any) -> Callable[[Any], Any]:
    if hint in _CASTS:
        return _CASTS[hint]
    if isinstance(hint, type) and issubclass(hint, Record):
        return functools.partial(_record, dtype_of(hint))
    if get_origin(hint) is Records:
        return functools.partial(_records, dtype_of(get_args(hint)[0]))
    return lambda given: given


def _record(dtype: np.dtype[np.void], given: Any) -> Any:
    return record(given, dtype) if isinstance(given, np.ndarray) else given


def _records(dtype: np.dtype[np.void], given: Any) -> Any:
    return given if given.dtype.names else given.reshape(-1).view(dtype)


def _array(dtype: str, given: Any) -> Any:
    found = np.ascontiguousarray(given, dtype=dtype)
    return found if found.flags.writeable else found.copy()  # compiled once, not for read-only arrays, too


def _of_array(read: Callable[..., Any], of: type, given: Any) -> Any:
    return given if isinstance(given, of) else getattr(read, "py_func", read)(np.asarray(given, dtype=float))


_CASTS: Final[dict[Any, Callable[[Any], Any]]] = {
    float: float, int: int, bool: bool, Array: functools.partial(_array, "f8"),
    WholeArray: functools.partial(_array, "i8"), Vec: functools.partial(_of_array, vec, Vec),
    Mat: functools.partial(_of_array, mat, Mat), Spatial: functools.partial(_of_array, spatial, Spatial),
}  # fmt: skip
