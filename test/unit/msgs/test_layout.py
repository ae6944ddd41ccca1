"""Where fields lie by a schema: against an independent encoder, and every way a text or a message is wrong."""

from __future__ import annotations

import importlib
import struct
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from slip_bags.typedefs import find_definition
from slip_core.errors import InputError
from slip_msgs_py.messages.layout import Field, Layout, Schema, parse_fields

LINE = "=" * 80
INNER = "uint8 flag\nfloat64[2] pair\nstring word\n"
NOTHING = "# nothing but a comment\n"
ALL = f"""# everything a message may have

int32 LIMIT=7   # a constant
string NAME = "x"
bool on
int8[3] small
uint16 count   # behind it: padding
float64 value
string name
string[] words
string[2] two
Inner inner
q/Inner[] others
q/msg/Inner[2] both
Nothing empty
char behind
float32[<=4] few
int64[] none
int64[] still_none
int64[] many
float64[] single
float64[] another
uint32 number
byte[] raw
{LINE}
MSG: p/Inner
{INNER}{LINE}
MSG: q/Inner
{INNER}{LINE}
MSG: p/Nothing
{NOTHING}"""
SCHEMA = Schema.from_text("p/msg/All", ALL)


def message_of_all(little_endian: bool) -> tuple[bytes, dict[str, Any]]:
    """Return a message as rosbags encodes it, and its values by path."""
    store = Typestore()
    store.register(get_types_from_msg(ALL, "p/msg/All"))
    types = store.types
    values: dict[str, Any] = {}

    def inner(kind: str, path: str, k: int) -> Any:
        word, pair = "w" * k, np.array([0.5 + k, -k])
        values.update({f"{path}.flag": 7 + k, f"{path}.pair": pair, f"{path}.word": word})
        return types[f"{kind}/msg/Inner"](flag=7 + k, pair=pair, word=word)

    plain = {
        "on": True, "small": np.array([1, -2, 3], np.int8), "count": 60_000, "value": -0.1, "name": "näme",
        "words": ["", "a", "bcd"], "two": ["x", "yy"], "few": np.array([1.5, 2.5, -3.5], np.float32),
        "none": np.array([], np.int64), "still_none": np.array([], np.int64), "many": np.array([-(2**62), 3]),
        "single": np.array([0.1]), "another": np.array([0.2]), "number": 2**31 + 5, "behind": 200,
        "raw": np.array([9, 8], np.uint8),
    }  # fmt: skip
    nested = {
        "inner": inner("p", "inner", 1),
        "others": [inner("q", f"others[{k}]", k) for k in range(3)],
        "both": [inner("q", f"both[{k}]", k + 4) for k in range(2)],
        "empty": types["p/msg/Nothing"](),
    }
    message = types["p/msg/All"](**plain, **nested)
    data = bytes(store.serialize_cdr(message, "p/msg/All", little_endian=little_endian))
    return data, {**plain, **values}


def read(layout: Layout, data: bytes) -> dict[str, Any]:
    """Return what lies at the places of a layout."""
    order, found = "<" if layout.little_endian else ">", {}
    for leaf in layout.leaves:
        numbers = np.frombuffer(data, order + leaf.dtype, 1 if leaf.count is None else leaf.count, leaf.offset)
        found[leaf.path] = numbers[0] if leaf.count is None else numbers
    for text in layout.texts:
        words = [data[at : at + size].decode() for at, size in text.places]
        found[text.path] = words if text.is_array else words[0]
    return found


@pytest.mark.parametrize("little_endian", [True, False])
def test_every_form_of_field_is_where_another_encoder_has_put_it(little_endian: bool) -> None:
    data, values = message_of_all(little_endian)
    layout = SCHEMA.layout(data)
    found = read(layout, data)
    assert found.keys() == values.keys()
    for path, value in values.items():
        np.testing.assert_array_equal(found[path], value, err_msg=path)
    assert layout.little_endian == little_endian
    assert layout.length == len(data)
    for at, size in layout.sizes:
        assert struct.unpack_from("<I" if little_endian else ">I", data, at) == (size,)
    assert [size for _, size in layout.sizes].count(0) == 2, "the two sequences that are empty"


def test_a_message_that_is_cut_anywhere_is_refused_and_one_with_more_behind_it_is_not() -> None:
    data, values = message_of_all(True)
    for length in range(len(data)):
        with pytest.raises(InputError, match="plain CDR" if length < 4 else "a message that is cut"):
            SCHEMA.layout(data[:length])
    longer = data + b"\0\0\0"
    assert read(SCHEMA.layout(longer), longer).keys() == values.keys()
    assert SCHEMA.layout(longer).length == len(data)


def test_windows_line_ends_change_nothing() -> None:
    assert Schema.from_text("p/msg/All", ALL.replace("\n", "\r\n")).types == SCHEMA.types


@pytest.mark.parametrize(
    "name",
    ["sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry", "diagnostic_msgs/msg/DiagnosticArray",
     "trajectory_msgs/msg/MultiDOFJointTrajectory", "std_msgs/msg/Float64MultiArray", "std_msgs/msg/Bool"],
)  # fmt: skip
def test_the_generated_class_says_what_the_text_says(name: str) -> None:
    package, _, kind = name.split("/")
    of_class = Schema.of_class(getattr(importlib.import_module(f"{package}.msg"), kind))
    of_text = Schema.from_text(name, find_definition(name))
    assert of_class.types == of_text.types
    assert of_class.root == of_text.root


def test_names_without_a_package_are_of_the_package_they_stand_in() -> None:
    fields = parse_fields("Point a\nother/Point[3] b\nother/msg/Point[] c\nwstring d\nint32 N=1\n", "here", "text")
    assert fields == [
        Field("a", "here/Point", None), Field("b", "other/Point", 3), Field("c", "other/Point", 0),
        Field("d", "wstring", None),
    ]  # fmt: skip


@pytest.mark.parametrize("head", [b"", b"\0\1", b"\1\1\0\0", b"\0\3\0\0", b"\0\2\0\0"])
def test_what_is_no_plain_cdr_is_refused(head: bytes) -> None:
    with pytest.raises(InputError, match=r"plain CDR \(0000 or 0001\)"):
        Schema.from_text("a/msg/B", "uint8 x\n").layout(head + b"\0" * (4 if len(head) == 4 else 0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Self s\n", "types that contain themselves"), ("Such s\n", "a type without definition"),
        ("wstring s\n", "a wstring"), (f"int8 a\n{LINE}\nMSX: a/B\n", "MSG: and a type name"), ("%$\n", "a field"),
        ("Point[] p\n", "a message that is cut"),
    ],
)  # fmt: skip
def test_what_makes_no_sense_is_refused_in_one_line(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Schema.from_text("a/msg/Self", text).layout(b"\0\1\0\0" + struct.pack("<I", 2**31))


@pytest.mark.parametrize(("size", "place"), [("", ""), ("[1]", "[0]")])
def test_types_may_stand_in_each_other_up_to_a_depth(size: str, place: str) -> None:
    def nested(depth: int) -> Schema:
        fields = [f"T{k + 1}{size} x\n" if k < depth else "uint8 x\n" for k in range(depth + 1)]
        blocks = [f"{LINE}\nMSG: a/T{k}\n{field}" for k, field in enumerate(fields) if k > 0]
        return Schema.from_text("a/msg/T0", fields[0] + "".join(blocks))

    assert nested(32).layout(b"\0\1\0\0\7").leaves[0].path == f"x{place}." * 32 + "x"
    with pytest.raises(InputError, match="contain themselves"):
        nested(33).layout(b"\0\1\0\0\7")


def test_what_belongs_to_no_field_is_padding() -> None:
    """CDR aligns a number to its size, counted from behind the four bytes of the head."""
    text = "bool a\nfloat64 b\nbool c\nuint16 d\nstring e\nuint32 f\nuint8[] g\nfloat64 h\n"
    data = b"\0\1\0\0" + struct.pack("<B7xdBxHI2s2xII4xd", 1, 2.0, 1, 3, 2, b"x\0", 4, 0, 5.0)
    layout = Schema.from_text("a/msg/B", text).layout(data)
    assert layout.length == len(data)
    assert layout.padding() == [5, 6, 7, 8, 9, 10, 11, 21, 30, 31, 40, 41, 42, 43]


def test_a_string_without_its_final_zero_is_empty() -> None:
    data = b"\0\1\0\0" + struct.pack("<IB", 0, 7)
    assert read(Schema.from_text("a/msg/B", "string a\nuint8 b\n").layout(data), data) == {"a": "", "b": 7}
