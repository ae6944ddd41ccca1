"""Text and arrays as one block of bytes: a JSON header that refers to the arrays behind it.

uint32 length of the header | header, UTF-8, filled with spaces to a multiple of 4 | the arrays, little endian
"""

from __future__ import annotations

import json
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

ARRAY: Final = "$array"


class Packer:
    """Collects arrays; `add` returns the entry of an array in the header."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, values: ArrayLike) -> dict[str, list[Any]]:
        """Keep an array, as float32, or as uint32 where it holds whole numbers; any shape, row by row."""
        array: NDArray[Any] = np.asarray(values)
        kind = "u4" if np.issubdtype(array.dtype, np.integer) else "f4"
        data = np.ascontiguousarray(array, dtype=f"<{kind}").tobytes()
        reference = {ARRAY: [kind, self._size, array.size]}
        self._parts.append(data)
        self._size += len(data)
        return reference

    def pack(self, header: object) -> bytes:
        """Return header and arrays as one block, not compressed."""
        text = json.dumps(header, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        return b"".join([len(text).to_bytes(4, "little"), text, *self._parts])
