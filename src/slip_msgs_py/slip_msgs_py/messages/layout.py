"""Where each field of a typed message lies in its CDR bytes: found by walking the message, not its bytes.

A layout belongs to one shape of message: the sizes of all strings and sequences.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any, Final

SIZES: Final = {
    "boolean": 1, "octet": 1, "char": 1, "float": 4, "double": 8,
    **{f"{sign}int{8 * size}": size for sign in ("", "u") for size in (1, 2, 4, 8)},
}  # fmt: skip
"""Bytes of a number by its name in a generated class."""
HEADER_BYTES: Final = 4
_SEQUENCE: Final = re.compile(r"sequence<(?P<element>[^,]+)(?:, \d+)?>")
_FIXED: Final = re.compile(r"(?P<element>.+)\[\d+\]")


@dataclass(frozen=True, slots=True)
class Leaf:
    """A number, or an array of numbers, at its place."""

    path: str
    kind: str
    offset: int
    count: int


@dataclass(slots=True)
class Layout:
    """The numbers of a message, the bytes that belong to a field, and the length in bytes."""

    leaves: list[Leaf] = field(default_factory=list)
    used: set[int] = field(default_factory=lambda: set(range(HEADER_BYTES)))
    length: int = HEADER_BYTES

    @property
    def padding(self) -> list[int]:
        """Offsets of the bytes that belong to no field."""
        return sorted(set(range(self.length)) - self.used)

    def _take(self, size: int, count: int = 1) -> int:
        """Return where `count` numbers of a size lie, which are next; no number takes no alignment either."""
        if count:
            self.length += -(self.length - HEADER_BYTES) % size
        at = self.length
        self.length += size * count
        self.used.update(range(at, self.length))
        return at


def layout_of(message: Any) -> Layout:
    """Return the layout of a typed message.

    Raises:
        ValueError: a field of a kind that CDR version 1 does not define here (wstring).
    """
    layout = Layout()
    _walk(layout, message, "")
    return layout


def _walk(layout: Layout, message: Any, prefix: str) -> None:
    fields = message.get_fields_and_field_types()
    if not fields:
        layout._take(1)  # the one byte that an empty structure has in IDL
    for name, kind in fields.items():
        path, value = prefix + name, getattr(message, name)
        array = _SEQUENCE.fullmatch(kind) or _FIXED.fullmatch(kind)
        if array is not None and array.re is _SEQUENCE:
            layout._take(4)
        element, values = (array["element"], value) if array is not None else (kind, [value])
        if element in SIZES:
            at = layout._take(SIZES[element], len(values))
            layout.leaves.append(Leaf(path, element, at, len(values)))
        elif element.startswith("string"):
            for text in values:
                layout._take(4)
                layout._take(1, len(text.encode()) + 1)
        elif "/" in element:
            for index, part in enumerate(values):
                _walk(layout, part, f"{path}[{index}]." if array is not None else f"{path}.")
        else:
            raise ValueError(f"{path}: {element} is no number, string or message")
