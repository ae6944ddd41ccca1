"""Where each field of a CDR message lies, from its schema: a ``ros2msg`` text or a generated class; no ROS needed.

A layout belongs to one shape of message: the sizes of all strings and sequences. Messages of one topic nearly
always share it, so that columns can be cut out of many messages at once, and numbers be put in place.
"""

from __future__ import annotations

import importlib
import re
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from slip_core.errors import InputError

DTYPES: Final[Mapping[str, str]] = {
    "bool": "?",
    "byte": "u1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "float32": "f4",
    "float64": "f8",
    **{f"{sign}int{8 * size}": f"{sign or 'i'}{size}" for sign in ("", "u") for size in (2, 4, 8)},
}
_SIZES: Final = {name: 1 if code == "?" else int(code[1]) for name, code in DTYPES.items()}
_HEADER_BYTES: Final = 4
_MAX_DEPTH: Final = 32
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z]\w*(?:/\w+){0,2})(?:<=\d+)?(?P<array>\[(?:(?P<size>\d+)|<=\d+)?\])?\s+(?P<name>[A-Za-z]\w*)(?P<rest>.*)$"
)
_SEPARATOR = re.compile(r"^=+\n", re.MULTILINE)
_IDL_NAMES: Final = {"boolean": "bool", "octet": "byte", "float": "float32", "double": "float64"}
_IDL_ARRAY: Final = re.compile(r"sequence<(?P<sequence>[^,]+)(?:, \d+)?>|(?P<fixed>.+)\[(?P<size>\d+)\]")


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message type; `size` is None for a plain value, 0 for a sequence, else a fixed array's size."""

    name: str
    type_name: str
    size: int | None


@dataclass(frozen=True, slots=True)
class Leaf:
    """A number, or array of numbers, at a fixed place: `count` is None for a plain value."""

    path: str
    dtype: str
    offset: int
    count: int | None

    @property
    def size(self) -> int:
        """Bytes of one number."""
        return 1 if self.dtype == "?" else int(self.dtype[1])


@dataclass(frozen=True, slots=True)
class Text:
    """A string, or array of strings, at fixed places; each place is (offset, bytes without the final zero)."""

    path: str
    places: tuple[tuple[int, int], ...]
    is_array: bool


@dataclass(frozen=True, slots=True)
class Layout:
    """One shape: its fields, the (offset, value) pairs of all size words that make it this shape, and its bytes."""

    leaves: tuple[Leaf, ...]
    texts: tuple[Text, ...]
    sizes: tuple[tuple[int, int], ...]
    little_endian: bool
    length: int

    def padding(self) -> list[int]:
        """Return the offsets of the bytes that belong to no field."""
        used = [(0, _HEADER_BYTES), *((at, 4) for at, _ in self.sizes)]
        used += [(leaf.offset, leaf.size * (1 if leaf.count is None else leaf.count)) for leaf in self.leaves]
        used += [(at, size + 1) for text in self.texts for at, size in text.places]
        return sorted(set(range(self.length)).difference(*(range(at, at + size) for at, size in used)))


class Schema:
    """A message type with all it refers to.

    Args:
        type_name: ``pkg/msg/Type``.
        types: fields of each type, ``pkg/Type``.
    """

    def __init__(self, type_name: str, types: Mapping[str, tuple[Field, ...]]) -> None:
        self.type_name, self.types = type_name, types
        self.root = _short(type_name)

    @classmethod
    def of_class(cls, kind: Any) -> Schema:
        """Return the schema of a generated message class."""
        types: dict[str, tuple[Field, ...]] = {}
        root, left = _class_name(kind), [kind]
        while left:
            kind, fields = left.pop(), []
            for name, text in kind.get_fields_and_field_types().items():
                array = _IDL_ARRAY.fullmatch(text)
                element = text if array is None else array["sequence"] or array["fixed"]
                type_name = "string" if element.startswith("string") else _IDL_NAMES.get(element, element)
                fields.append(Field(name, type_name, None if array is None else int(array["size"] or 0)))
                package, sign, message = type_name.partition("/")
                if sign:
                    left.append(getattr(importlib.import_module(f"{package}.msg"), message))
            types[_class_name(kind)] = tuple(fields)
        return cls(root, types)

    @classmethod
    def from_text(cls, type_name: str, text: str) -> Schema:
        """Return the schema of a text as a bag stores it.

        Raises:
            InputError: where the text is not of this form.
        """
        types: dict[str, tuple[Field, ...]] = {}
        first, *others = _SEPARATOR.split(text.replace("\r\n", "\n"))
        blocks = [(_short(type_name), first)]
        for block in others:
            head, _, body = block.partition("\n")
            if not head.startswith("MSG: "):
                raise InputError(f"schema of {type_name}", got=head, expected="MSG: and a type name")
            blocks.append((_short(head.removeprefix("MSG: ").strip()), body))
        for name, body in blocks:
            types[name] = tuple(parse_fields(body, name.partition("/")[0], f"schema of {type_name}"))
        return cls(type_name, types)

    def layout(self, data: bytes) -> Layout:
        """Return the layout of one message.

        Raises:
            InputError: where the message is shorter than its own sizes say, or not plain CDR.
        """
        try:
            return _Walker(self, data).run()
        except (struct.error, KeyError, IndexError) as error:
            detail = f"a type without definition: {error}" if isinstance(error, KeyError) else "a message that is cut"
            raise InputError(f"message of {self.type_name}", got=detail, expected="what its schema describes") from None


def parse_fields(text: str, package: str, what: str) -> list[Field]:
    """Return the fields of one .msg text, without its constants; unqualified types belong to `package`.

    Raises:
        InputError: a line that is no field; `what` names the text.
    """
    fields = []
    for line in text.splitlines():
        content = line.partition("#")[0].strip()
        if not content:
            continue
        match = _FIELD.match(content)
        if match is None:
            raise InputError(what, got=line, expected="a field: type and name")
        if match["rest"].lstrip().startswith("="):
            continue  # a constant
        kind = match["type"]
        known = kind in DTYPES or kind in ("string", "wstring")
        type_name = kind if known else _short(kind if "/" in kind else f"{package}/{kind}")
        fields.append(Field(match["name"], type_name, int(match["size"] or 0) if match["array"] else None))
    return fields


class _Walker:
    """Walks one message and notes where everything is."""

    def __init__(self, schema: Schema, data: bytes) -> None:
        self._schema, self._data = schema, data
        if len(data) < _HEADER_BYTES or data[0] != 0 or data[1] not in (0, 1):
            got = f"encapsulation {data[:2].hex() or 'none'}"
            raise InputError(f"message of {schema.type_name}", got=got, expected="plain CDR (0000 or 0001)")
        self._little_endian = data[1] == 1
        self._uint32 = struct.Struct("<I" if self._little_endian else ">I")
        self._position = _HEADER_BYTES
        self._leaves: list[Leaf] = []
        self._texts: list[Text] = []
        self._sizes: list[tuple[int, int]] = []

    def run(self) -> Layout:
        self._struct(self._schema.root, "", 0)
        if self._position > len(self._data):
            raise IndexError
        return Layout(tuple(self._leaves), tuple(self._texts), tuple(self._sizes), self._little_endian, self._position)

    def _struct(self, type_name: str, prefix: str, depth: int) -> None:
        if depth > _MAX_DEPTH:
            raise InputError(
                f"schema of {self._schema.type_name}", got="types that contain themselves", expected="a tree"
            )
        if self._position > len(self._data):  # a type's size may be a power of the length of its text
            raise IndexError
        fields = self._schema.types[type_name]
        if not fields:
            self._position += 1  # the one byte an empty structure has in IDL
        for field in fields:
            self._field(field, prefix + field.name, depth)

    def _field(self, field: Field, path: str, depth: int) -> None:
        count = field.size
        if count == 0:
            count = self._size()
            if count > len(self._data) - self._position:  # every element takes at least one byte
                raise IndexError
        if field.type_name in DTYPES:
            size = _SIZES[field.type_name]
            if count != 0:
                self._align(size)
            self._leaves.append(Leaf(path, DTYPES[field.type_name], self._position, count))
            self._position += size * (1 if count is None else count)
        elif field.type_name == "string":
            places = tuple(self._string() for _ in range(1 if count is None else count))
            self._texts.append(Text(path, places, count is not None))
        elif field.type_name == "wstring":
            raise InputError(f"message of {self._schema.type_name}", got="a wstring", expected="types without wstring")
        elif count is None:
            self._struct(field.type_name, f"{path}.", depth + 1)
        else:
            for index in range(count):
                self._struct(field.type_name, f"{path}[{index}].", depth + 1)

    def _align(self, size: int) -> None:
        self._position += -(self._position - _HEADER_BYTES) % size

    def _size(self) -> int:
        self._align(4)
        (value,) = self._uint32.unpack_from(self._data, self._position)
        self._sizes.append((self._position, value))
        self._position += 4
        return int(value)

    def _string(self) -> tuple[int, int]:
        length = self._size()
        place = (self._position, max(length - 1, 0))
        self._position += length
        if self._position > len(self._data):
            raise IndexError
        return place


def _class_name(kind: type) -> str:
    return f"{kind.__module__.partition('.')[0]}/{kind.__name__}"


def _short(type_name: str) -> str:
    """``pkg/msg/Type`` and ``pkg/Type`` name the same type."""
    parts = type_name.split("/")
    return f"{parts[0]}/{parts[-1]}"
