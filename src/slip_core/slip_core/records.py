"""Records: one numpy dtype is the one declaration of a layout, for Python, for compiled code, for bags and topics.

Numbers lie in flat float64 buffers; `record(buffer, LAYOUT)` looks at one by name, reads and writes through. Every
field is REAL or WHOLE, 8 bytes each, an array of them, or another layout, so a buffer's bytes are the record's.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload

from slip_core.arrays import Array

REAL, WHOLE = "f8", "i8"


def layout(**fields: Any) -> np.dtype[np.void]:
    """Return a layout of named fields.

    Args:
        fields: REAL, WHOLE or another layout; with a shape as a pair, for instance (REAL, (3, 3)) or (CONTACT, 2).
    """
    described = [(name, *kind) if isinstance(kind, tuple) else (name, kind) for name, kind in fields.items()]
    return np.dtype(described)


def new(dtype: np.dtype[np.void]) -> Array:
    """Return a buffer of zeros for a layout."""
    return np.zeros(dtype.itemsize // 8)


def record(buffer: Array, dtype: np.dtype[np.void]) -> Any:
    """Return the view of a buffer by name.

    Args:
        buffer: float64, as `new` makes it.
        dtype: its layout; in compiled code a module's constant.
    """
    return buffer.view(dtype).view(np.recarray)[0]


@overload(record)
def _compiled_record(buffer, dtype):  # type: ignore[no-untyped-def]
    return lambda buffer, dtype: buffer.view(dtype)[0]


def records(matrix: Array, dtype: np.dtype[np.void]) -> Any:
    """Return the view of a matrix (n, size of the layout) as n records, one per row.

    Args:
        matrix: float64, by rows.
        dtype: layout of a row; in compiled code a module's constant.
    """
    return matrix.reshape(matrix.size).view(dtype).view(np.recarray)


@overload(records)
def _compiled_records(matrix, dtype):  # type: ignore[no-untyped-def]
    return lambda matrix, dtype: matrix.reshape(matrix.size).view(dtype)


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
