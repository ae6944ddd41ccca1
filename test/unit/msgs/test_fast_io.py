"""Senders and receivers: what they make equals the typed way, and bad messages are refused and counted."""

from __future__ import annotations

import struct
from functools import partial
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, TwistStamped, Vector3, WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from rosbags.typesys import Stores, get_typestore
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray, Header, Int64MultiArray

from slip_core.errors import InputError
from slip_core.stamps import split_ns
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_msgs_py import fast_io
from slip_msgs_py.fast_io import Refusals, Sender, typed
from slip_msgs_py.messages import from_msgs, to_msgs

NAMES = ("a", "bb", "ccc")
STAMP_NS = 3_000_000_007
QUIET_NAN_WITH_PAYLOAD = struct.unpack("<d", struct.pack("<Q", 0x7FF8_0000_DEAD_BEEF))[0]


class Wire:
    """Stands for an rclpy publisher: keeps what is published."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.handle = self

    def publish_raw(self, data: bytes) -> None:
        assert type(data) is bytes
        self.sent.append(data)


def read_joints(data: bytes) -> JointSample:
    return from_msgs.joint_sample(typed(data, JointState), NAMES)


def joint_state(names: tuple[str, ...] = NAMES, **arrays: Any) -> bytes:
    return serialize_message(JointState(header=to_msgs.header(STAMP_NS, ""), name=list(names), **arrays))


PLACE, TURNED = np.array([1.0, 2, 3]), np.eye(3)[[1, 2, 0]]
SENT = {
    "joint state": (to_msgs.joint_state(NAMES), (np.arange(3.0), np.arange(3.0) + 1, np.arange(3.0) + 2)),
    "no command": (to_msgs.joint_state(NAMES), (np.arange(3.0), np.arange(3.0) + 1, np.zeros(0))),
    "slip truth": (
        to_msgs.joint_state(("s_x", "s_y"), "position", "velocity"),
        (np.arange(6.0) + 1, np.arange(6.0) + 2),
    ),
    "scalars": (to_msgs.joint_state(("K_x", "gate"), "position"), ((1.5, float("inf")),)),
    "wrench": (to_msgs.wrench("ee"), (np.arange(6.0),)),
    "twist": (to_msgs.twist("ee"), (np.arange(6.0),)),
    "pose": (to_msgs.pose(), (to_msgs.pose_numbers(PLACE, TURNED),)),
    "odometry": (to_msgs.ODOMETRY, to_msgs.odometry_numbers(PLACE, TURNED, np.arange(6.0))),
    "clock": (to_msgs.CLOCK, ()),
    "whole numbers": (to_msgs.WHOLE_NUMBERS, ((1, -(2**63), 2**63 - 1),)),
    "number": (to_msgs.NUMBER, ((2.5,),)),
    "numbers": (to_msgs.NUMBERS, (np.array([0.5, -0.0]),)),
}


@pytest.mark.parametrize("case", SENT.values(), ids=SENT.keys())
def test_what_is_sent_decodes_to_the_typed_message(case: tuple[to_msgs.Form, tuple[Any, ...]]) -> None:
    form, numbers = case
    wire = Wire()
    sender = Sender(wire, form)
    assert sender.publisher is wire  # a node waits for its publishers before it ends
    for stamp_ns in (0, STAMP_NS, 2**31 * 1_000_000_000 - 1):
        sender.send(stamp_ns, *numbers)
        typed_message = form.message(stamp_ns, *numbers)
        assert typed(wire.sent.pop(), type(typed_message)) == typed_message


@pytest.mark.parametrize("sizes", [(3, 3, 3), (1, 1, 1), (3, 0, 3), (0, 3, 0), (0, 0, 0)])
@pytest.mark.parametrize("names", [("a", "bcd", "ef"), ("joint_1",)])
def test_bytes_that_align_are_zero(names: tuple[str, ...], sizes: tuple[int, ...]) -> None:
    """The referee writes the message without rclpy."""
    data = Sender(Wire(), to_msgs.joint_state(names)).encode(STAMP_NS, *(np.ones(size) for size in sizes))
    types = get_typestore(Stores.ROS2_JAZZY).types
    stamp = types["builtin_interfaces/msg/Time"](*split_ns(STAMP_NS))
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
    numbers = dict(zip(("position", "velocity", "effort"), map(np.ones, sizes), strict=True))
    message = types["sensor_msgs/msg/JointState"](header=header, name=list(names), **numbers)
    expected = bytes(get_typestore(Stores.ROS2_JAZZY).serialize_cdr(message, "sensor_msgs/msg/JointState"))
    assert data == expected


def test_every_bit_of_a_number_is_sent() -> None:
    values = [0.0, -0.0, float("inf"), 5e-324, -1.7976931348623157e308, QUIET_NAN_WITH_PAYLOAD]
    data = typed(Sender(Wire(), to_msgs.NUMBERS).encode(0, values), Float64MultiArray).data
    assert data.tobytes() == np.array(values).tobytes()


def test_a_typed_message_is_what_its_form_describes() -> None:
    stamp, ones = to_msgs.header(STAMP_NS, "").stamp, {"x": 1.0, "y": 2.0, "z": 3.0}
    twos = {"x": 4.0, "y": 5.0, "z": 6.0}
    six = Twist(linear=Vector3(**ones), angular=Vector3(**twos))
    place = Pose(position=Point(**ones), orientation=Quaternion(**twos, w=7.0))
    odometry = Odometry(header=Header(stamp=stamp, frame_id="world"), child_frame_id="object")
    odometry.pose.pose, odometry.twist.twist = place, six
    seven = np.arange(1.0, 8.0)
    assert to_msgs.ODOMETRY.message(STAMP_NS, seven, seven[:6]) == odometry
    assert to_msgs.CLOCK.message(STAMP_NS) == Clock(clock=stamp)
    assert to_msgs.WHOLE_NUMBERS.message(0, (1, -5)) == Int64MultiArray(data=[1, -5])
    assert to_msgs.NUMBER.message(0, (2.5,)) == Float64(data=2.5)
    named = JointState(header=Header(stamp=stamp), name=["a", "b"], position=[1.0, 2.0])
    assert to_msgs.joint_state(("a", "b"), "position").message(STAMP_NS, (1.0, 2.0)) == named


def test_an_invalid_slip_sample_is_sent_as_nan_and_arrives_invalid() -> None:
    wire = Wire()
    sample = SlipSample(STAMP_NS, np.ones(6), valid=False)
    Sender(wire, to_msgs.twist("ee")).send(STAMP_NS, to_msgs.slip_numbers(sample))
    arrived = from_msgs.slip_velocity(typed(wire.sent[0], TwistStamped), "ee")
    assert not arrived.valid
    assert np.isnan(arrived.twist).all()


@given(st.lists(st.tuples(st.permutations(NAMES), st.booleans(), st.sampled_from(["", "base", "world"])), max_size=40))
def test_joints_are_sorted_whatever_order_frame_and_fields_the_messages_have(
    messages: list[tuple[list[str], bool, str]],
) -> None:
    values = dict(zip(NAMES, (1.0, 20.0, 300.0), strict=True))
    for i, (names, with_effort, frame) in enumerate(messages):
        position = [i + values[name] for name in names]
        velocity = [-value for value in position]
        effort = [2 * value for value in position] if with_effort else []
        message = JointState(
            header=to_msgs.header(i, frame), name=names, position=position, velocity=velocity, effort=effort
        )
        sample = read_joints(serialize_message(message))
        expected = np.array([i + values[name] for name in NAMES])
        assert sample.stamp_ns == i
        assert sample.position.tolist() == expected.tolist()
        assert sample.velocity.tolist() == (-expected).tolist()
        assert sample.effort.tolist() == (2 * expected if with_effort else 0 * expected).tolist()


def test_a_long_message_is_not_read() -> None:
    with pytest.raises(InputError, match="message: got 65537 bytes, expected at most 65536"):
        typed(bytes((1 << 16) + 1), JointState)


def test_each_new_fault_is_reported_once_and_every_message_counted() -> None:
    lines: list[str] = []
    refusals = Refusals(lines.append)
    for got, expected in ((1, "2"), (0, "2"), (1, "2"), (1, "3"), (1, "2")):
        refusals.add("wrench", InputError("x", got=got, expected=expected))
    refusals.add("slip", InputError("x", got=1, expected="2"))
    assert refusals.counts == {"wrench": 5, "slip": 1}
    assert lines == [
        "wrench: message refused: x: got 1, expected 2",
        "wrench: message refused: x: got 1, expected 3",
        "slip: message refused: x: got 1, expected 2",
    ]
    assert refusals.last("wrench") == "x: got 1, expected 2"
    assert refusals.last("clock") == ""


def test_a_message_of_another_type_is_not_taken_for_this_one() -> None:
    with pytest.raises(InputError, match="TwistStamped"):
        typed(serialize_message(Header()), TwistStamped)


def test_a_stamp_that_could_not_be_sent_back_is_refused() -> None:
    """`nanosec` is a uint32; a second of them or more would carry into `sec`, and beyond it near the largest."""
    good = JointState(name=list(NAMES), position=[1.0] * 3, velocity=[0.0] * 3, effort=[0.0] * 3)
    for sec, nanosec in ((2**31 - 1, 999_999_999), (-(2**31), 0), (0, 0)):
        good.header.stamp.sec, good.header.stamp.nanosec = sec, nanosec
        assert read_joints(serialize_message(good)).stamp_ns == sec * 1_000_000_000 + nanosec
    for sec, nanosec in ((2**31 - 1, 2**32 - 1), (0, 1_000_000_000), (-1, 2**32 - 1)):
        good.header.stamp.sec, good.header.stamp.nanosec = sec, nanosec
        with pytest.raises(InputError, match=r"stamp: got .* nanoseconds"):
            read_joints(serialize_message(good))


def test_a_receiver_subscribes_to_bytes_and_reports_under_the_name_it_listens_to(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[tuple[Any, ...], dict[str, Any]]] = []
    monkeypatch.setattr(fast_io, "create_subscription", lambda *words, **more: asked.append((words, more)))
    refusals, read = Refusals(lambda _: None), partial(from_msgs.wrench_sample, frame="ee")
    for name in ("wrench", "contact_1/wrench"):
        delivered: list[WrenchSample] = []
        fast_io.create_receiver(None, name, read, delivered.append, refusals, depth=3, reliable=True)
        (_, listened, take), more = asked.pop()
        assert (listened, more) == (name, {"depth": 3, "reliable": True, "raw": True})
        take(serialize_message(WrenchStamped()))
        assert len(delivered) == 1
        take(b"rubbish")
        assert refusals.counts[name] == 1
