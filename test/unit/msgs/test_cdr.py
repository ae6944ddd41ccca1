"""The fast codec against rclpy's own typed encoder and decoder, which are the referee of every case."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header, Int64MultiArray

from slip_msgs_py.messages import cdr
from slip_msgs_py.messages.cdr import CdrCodec, block_under, laid_out, numbers_at
from slip_msgs_py.messages.layout import SIZES, Layout, layout_of

NAMES = [f"arm_joint{i}" for i in range(1, 8)]
NS = 1_000_000_000
QUIET_NAN_WITH_PAYLOAD = struct.unpack("<d", struct.pack("<Q", 0x7FF8_0000_DEAD_BEEF))[0]
SPECIAL = [0.0, -0.0, float("inf"), float("-inf"), 5e-324, -2.2250738585072009e-308, 1.7976931348623157e308,
           QUIET_NAN_WITH_PAYLOAD, -QUIET_NAN_WITH_PAYLOAD]  # fmt: skip
doubles = st.one_of(st.floats(width=64, allow_nan=True, allow_infinity=True), st.sampled_from(SPECIAL))
stamps = st.integers(min_value=0, max_value=2**31 * NS - 1)


@dataclass(frozen=True)
class Kind:
    """One kind of message: a template, the fields that vary, their sizes and where its stamp is."""

    template: Callable[[], Any]
    fields: tuple[str, ...]
    sizes: tuple[int, ...]
    stamp: str = "header.stamp"
    whole: bool = False

    def codec(self) -> CdrCodec:
        return CdrCodec(self.template(), self.fields, self.stamp)


def _joint_state(names: list[str], frame: str = "", **sizes: int) -> JointState:
    arrays = {name: [0.0] * size for name, size in sizes.items()}
    return JointState(header=Header(frame_id=frame), name=names, **arrays)


KINDS = {
    "JointState": Kind(
        lambda: _joint_state(NAMES, position=7, velocity=7, effort=7), ("position", "velocity", "effort"), (7, 7, 7)
    ),
    "JointState without effort": Kind(
        lambda: _joint_state(NAMES, position=7, velocity=7), ("position", "velocity", "effort"), (7, 7, 0)
    ),
    "JointState with scalars": Kind(
        lambda: _joint_state([f"K_{i}" * (i % 4 + 1) for i in range(90)], position=90), ("position",), (90,)
    ),
    "JointState of one joint": Kind(
        lambda: _joint_state(["é"], "base", position=1, velocity=1), ("position", "velocity"), (1, 1)
    ),
    "WrenchStamped": Kind(lambda: WrenchStamped(header=Header(frame_id="ee")), ("wrench",), (6,)),
    "TwistStamped": Kind(lambda: TwistStamped(header=Header(frame_id="left/ee")), ("twist",), (6,)),
    "PoseStamped": Kind(lambda: PoseStamped(header=Header(frame_id="world")), ("pose",), (7,)),
    "Odometry": Kind(
        lambda: Odometry(header=Header(frame_id="world"), child_frame_id="object"), ("pose.pose", "twist.twist"), (7, 6)
    ),
    "Clock": Kind(Clock, (), (), stamp="clock"),
    "Int64MultiArray": Kind(lambda: Int64MultiArray(data=[0] * 5), ("data",), (5,), stamp="", whole=True),
    "Float64MultiArray": Kind(lambda: Float64MultiArray(data=[0.0] * 7), ("data",), (7,), stamp=""),
}  # fmt: skip
kinds = pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS.keys())


def bits(values: Any) -> list[int]:
    """Return numbers as whole numbers of their bits, so that NaN equals itself and -0.0 differs from 0.0."""
    array = np.asarray(values)
    return np.asarray(array, dtype=np.float64 if array.dtype.kind == "f" else np.int64).view(np.uint64).tolist()


@kinds
@given(data=st.data())
def test_codec_and_typed_code_read_bit_for_bit_what_the_other_writes(kind: Kind, data: st.DataObject) -> None:
    codec = kind.codec()
    number = st.integers(-(2**63), 2**63 - 1) if kind.whole else doubles
    arrays = [data.draw(st.lists(number, min_size=n, max_size=n)) for n in kind.sizes]
    stamp_ns = data.draw(stamps) if kind.stamp else 0
    written = codec.encode(stamp_ns, *arrays)
    message = deserialize_message(written, type(kind.template()))
    for path, values in zip(kind.fields, arrays, strict=True):
        assert bits(numbers_at(message, path)) == bits(values)
    if kind.stamp:
        stamp = numbers_at(message, kind.stamp)
        assert stamp[0] * NS + stamp[1] == stamp_ns

    # rclpy appends a few bytes of slack after an empty float64[]; whatever it leaves in the padding stays there.
    read = codec.decode(serialize_message(message)[: codec.size])
    assert read is not None
    assert read[0] == stamp_ns
    for got, values in zip(read[1], arrays, strict=True):
        assert bits(got) == bits(values)


@kinds
def test_everything_but_numbers_and_stamp_must_match(kind: Kind) -> None:
    codec = kind.codec()
    _, layout = laid_out(kind.template())
    written = codec.encode(0, *([0] * n for n in kind.sizes))
    free = set(layout.padding)
    for block in (block_under(layout, path) for path in kind.fields):
        free.update(range(block.offset, block.offset + 8 * block.count))
    for leaf in layout.leaves:
        if kind.stamp and leaf.path.startswith(f"{kind.stamp}."):
            free.update(range(leaf.offset, leaf.offset + SIZES[leaf.kind]))
    for at in range(len(written)):
        changed = bytearray(written)
        changed[at] ^= 0x20  # in a stamp still less than a second of nanoseconds
        assert (codec.decode(bytes(changed)) is not None) == (at in free), f"byte {at}"


@kinds
def test_cut_or_longer_data_is_not_read(kind: Kind) -> None:
    codec = kind.codec()
    written = codec.encode(0, *([0] * n for n in kind.sizes))
    assert codec.decode(written) is not None
    for length in range(len(written)):
        assert codec.decode(written[:length]) is None
    assert codec.decode(written + b"\0") is None


@kinds
def test_padding_is_zero(kind: Kind) -> None:
    written = kind.codec().encode(0, *([1] * n for n in kind.sizes))
    assert all(written[at] == 0 for at in laid_out(kind.template())[1].padding)


@pytest.mark.parametrize(
    "other",
    [
        _joint_state([*NAMES[:-1], "arm_joint8"], position=7, velocity=7, effort=7),
        _joint_state(NAMES[::-1], position=7, velocity=7, effort=7),
        _joint_state(NAMES, "base", position=7, velocity=7, effort=7),
        _joint_state(NAMES[:6], position=6, velocity=6, effort=6),
        _joint_state(NAMES, position=7, velocity=7, effort=6),
    ],
    ids=["other name", "other order", "other frame", "fewer joints", "an effort missing"],
)
def test_message_of_another_form_is_left_to_the_typed_decoder(other: JointState) -> None:
    codec = KINDS["JointState"].codec()
    assert codec.decode(serialize_message(other)) is None


def test_big_endian_is_left_to_the_typed_decoder() -> None:
    codec = KINDS["Clock"].codec()
    assert codec.decode(b"\x00\x00\x00\x00" + struct.pack(">iI", 1, 2)) is None


def test_arrays_read_are_read_only_and_do_not_change_with_the_next_message() -> None:
    codec = KINDS["WrenchStamped"].codec()
    read = codec.decode(codec.encode(0, np.arange(6.0)))
    assert read is not None
    codec.encode(0, np.zeros(6))
    assert read[1][0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    with pytest.raises(ValueError, match="read-only"):
        read[1][0][0] = 1.0


@pytest.mark.parametrize("sizes", [(6, 7, 7), (7, 7, 0), (7, 1, 7)])
def test_arrays_of_another_size_are_refused(sizes: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="for a field of 7"):
        KINDS["JointState"].codec().encode(0, *(np.zeros(n) for n in sizes))


@pytest.mark.parametrize(
    ("template", "fields", "stamp"),
    [
        (JointState(), ("positions",), "header.stamp"),
        (_joint_state(NAMES), ("name",), "header.stamp"),
        (JointState(), ("position",), "header"),
        (JointState(), ("position",), "clock"),
        (Odometry(), ("pose", "twist", "header"), "header.stamp"),
        (_joint_state(NAMES, position=7), ("header.stamp.nanosec",), "header.stamp"),
    ],
)
def test_fields_that_cannot_vary_are_refused(template: Any, fields: tuple[str, ...], stamp: str) -> None:
    with pytest.raises(ValueError, match=r"not a stamp|numbers"):
        CdrCodec(template, fields, stamp)


def test_a_layout_that_rclpy_does_not_share_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def shifted(message: Any) -> Layout:
        found = layout_of(message)
        found.leaves = [replace(leaf, offset=leaf.offset - 8 * (leaf.kind == "double")) for leaf in found.leaves]
        return found

    monkeypatch.setattr(cdr, "layout_of", shifted)
    with pytest.raises((ValueError, RuntimeError)):
        KINDS["JointState"].codec()
