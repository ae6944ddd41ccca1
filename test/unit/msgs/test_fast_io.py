"""Senders and receivers: what they make equals the typed way, and bad messages are refused and counted."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion, Twist, TwistStamped, Vector3, WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Header, Int64MultiArray

from slip_core.errors import InputError
from slip_core.types import JointSample, ObjectTruth, SlipSample, WrenchSample
from slip_msgs_py import fast_io
from slip_msgs_py.fast_io import Receiver, Refusals, Sender
from slip_msgs_py.messages import forms, from_msgs, to_msgs
from slip_msgs_py.messages.cdr import CdrCodec

NAMES = ("a", "bb", "ccc")
JOINT_FIELDS = ("position", "velocity", "effort")
STAMP_NS = 3_000_000_007


class Wire:
    """Stands for an rclpy publisher: keeps what is published."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []
        self.handle = self

    def publish_raw(self, data: bytes) -> None:
        assert type(data) is bytes
        self.sent.append(data)


def joint_receiver(names: tuple[str, ...] = NAMES) -> Receiver[JointSample]:
    return Receiver("sensor_msgs/msg/JointState", JOINT_FIELDS, partial(from_msgs.joint_samples, joints=names))


def joint_state(names: tuple[str, ...] = NAMES, **arrays: Any) -> bytes:
    return serialize_message(JointState(header=to_msgs.header(STAMP_NS, ""), name=list(names), **arrays))


TRUTH = ObjectTruth(
    STAMP_NS, np.array([1.0, 2, 3]), np.eye(3)[[1, 2, 0]], np.arange(6.0), np.arange(6.0) + 1, np.arange(6.0) + 2
)
SENT = {
    "joint state": (forms.joint_state(NAMES), (np.arange(3.0), np.arange(3.0) + 1, np.arange(3.0) + 2)),
    "no command": (forms.joint_state(NAMES), (np.arange(3.0), np.arange(3.0) + 1, np.zeros(0))),
    "slip truth": (forms.slip_truth(), (TRUTH.slip_displacement, TRUTH.slip_velocity)),
    "scalars": (forms.scalars(("K_x", "gate")), ((1.5, float("inf")),)),
    "wrench": (forms.wrench("ee"), (np.arange(6.0),)),
    "twist": (forms.twist("ee"), (np.arange(6.0),)),
    "pose": (forms.pose(), (to_msgs.pose_numbers(TRUTH.position, TRUTH.rotation),)),
    "odometry": (forms.odometry(), to_msgs.odometry_numbers(TRUTH)),
    "clock": (forms.clock(), ()),
    "whole numbers": (forms.whole_numbers(3), ((1, -(2**63), 2**63 - 1),)),
    "number": (forms.number(), ((2.5,),)),
    "numbers": (forms.numbers(2), (np.array([0.5, -0.0]),)),
}


@pytest.mark.parametrize("case", SENT.values(), ids=SENT.keys())
def test_what_is_sent_decodes_to_the_typed_message(case: tuple[forms.Form, tuple[Any, ...]]) -> None:
    form, numbers = case
    wire = Wire()
    sender = Sender(wire, form)
    sender.send(STAMP_NS, *numbers)
    assert sender.publisher is wire  # a node waits for its publishers before it ends
    typed = form.message(STAMP_NS, *numbers)
    assert deserialize_message(wire.sent[0], type(typed)) == typed


def test_a_typed_message_is_what_its_form_describes() -> None:
    stamp, ones = to_msgs.header(STAMP_NS, "").stamp, {"x": 1.0, "y": 2.0, "z": 3.0}
    twos = {"x": 4.0, "y": 5.0, "z": 6.0}
    six = Twist(linear=Vector3(**ones), angular=Vector3(**twos))
    place = Pose(position=Point(**ones), orientation=Quaternion(**twos, w=7.0))
    odometry = Odometry(header=Header(stamp=stamp, frame_id="world"), child_frame_id="object")
    odometry.pose.pose, odometry.twist.twist = place, six
    seven = np.arange(1.0, 8.0)
    assert forms.odometry().message(STAMP_NS, seven, seven[:6]) == odometry
    assert forms.clock().message(STAMP_NS) == Clock(clock=stamp)
    assert forms.whole_numbers(2).message(0, (1, -5)) == Int64MultiArray(data=[1, -5])
    assert forms.number().message(0, (2.5,)) == Float64(data=2.5)
    named = JointState(header=Header(stamp=stamp), name=["a", "b"], position=[1.0, 2.0])
    assert forms.scalars(("a", "b")).message(STAMP_NS, (1.0, 2.0)) == named


def test_an_invalid_slip_sample_is_sent_as_nan_and_arrives_invalid() -> None:
    wire = Wire()
    sample = SlipSample(STAMP_NS, np.ones(6), valid=False)
    Sender(wire, forms.twist("ee")).send(STAMP_NS, to_msgs.slip_numbers(sample))
    arrived = Receiver("geometry_msgs/msg/TwistStamped", ("twist",), lambda _: from_msgs.slip_sample)(wire.sent[0])
    assert not arrived.valid
    assert np.isnan(arrived.twist).all()


@given(st.lists(st.tuples(st.permutations(NAMES), st.booleans(), st.sampled_from(["", "base", "world"])), max_size=40))
def test_a_receiver_sorts_joints_whatever_order_frame_and_fields_the_messages_have(
    messages: list[tuple[list[str], bool, str]],
) -> None:
    receive = joint_receiver()
    values = dict(zip(NAMES, (1.0, 20.0, 300.0), strict=True))
    for i, (names, with_effort, frame) in enumerate(messages):
        position = [i + values[name] for name in names]
        velocity = [-value for value in position]
        effort = [2 * value for value in position] if with_effort else []
        message = JointState(
            header=to_msgs.header(i, frame), name=names, position=position, velocity=velocity, effort=effort
        )
        sample = receive(serialize_message(message))
        expected = np.array([i + values[name] for name in NAMES])
        assert sample.stamp_ns == i
        assert sample.position.tolist() == expected.tolist()
        assert sample.velocity.tolist() == (-expected).tolist()
        assert sample.effort.tolist() == (2 * expected if with_effort else 0 * expected).tolist()


def test_the_second_message_of_a_form_needs_no_typed_decoder(monkeypatch: pytest.MonkeyPatch) -> None:
    receive = Receiver("geometry_msgs/msg/WrenchStamped", ("wrench",), lambda _: WrenchSample)
    sender = Sender(Wire(), forms.wrench("tool"))
    receive(sender.encode(1, np.zeros(6)))
    monkeypatch.setattr(fast_io, "deserialize_message", None)
    sample = receive(sender.encode(2, np.arange(6.0)))
    assert (sample.stamp_ns, sample.wrench.tolist()) == (2, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    assert not sample.wrench.flags.writeable


def test_forms_beyond_those_a_receiver_learns_are_still_read(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[CdrCodec] = []

    def counting(*args: Any) -> CdrCodec:
        made.append(CdrCodec(*args))
        return made[-1]

    monkeypatch.setattr(fast_io, "CdrCodec", counting)
    receive = Receiver("geometry_msgs/msg/WrenchStamped", ("wrench",), lambda _: WrenchSample)
    for i in range(40):
        message = WrenchStamped(header=Header(frame_id=f"frame{i:03d}"))
        message.wrench.torque.z = float(i)
        assert receive(serialize_message(message)).wrench[5] == i
    assert len(made) == 16


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
    receive = Receiver("geometry_msgs/msg/TwistStamped", ("twist",), lambda _: from_msgs.slip_sample)
    receive(serialize_message(TwistStamped()))
    with pytest.raises(InputError, match="TwistStamped"):
        receive(serialize_message(Header()))


def test_a_stamp_that_could_not_be_sent_back_is_refused() -> None:
    """`nanosec` is a uint32; a second of them or more would carry into `sec`, and beyond it near the largest."""
    receiver = joint_receiver()
    good = JointState(name=list(NAMES), position=[1.0] * 3, velocity=[0.0] * 3, effort=[0.0] * 3)
    for sec, nanosec in ((2**31 - 1, 999_999_999), (-(2**31), 0), (0, 0)):
        good.header.stamp.sec, good.header.stamp.nanosec = sec, nanosec
        for _ in range(2):  # the typed way, then the quick one
            assert receiver(serialize_message(good)).stamp_ns == sec * 1_000_000_000 + nanosec
    for sec, nanosec in ((2**31 - 1, 2**32 - 1), (0, 1_000_000_000), (-1, 2**32 - 1)):
        good.header.stamp.sec, good.header.stamp.nanosec = sec, nanosec
        for way in (receiver, joint_receiver()):
            with pytest.raises(InputError, match=r"stamp: got .* nanoseconds"):
                way(serialize_message(good))


def test_a_receiver_subscribes_to_bytes_and_reports_under_the_name_it_listens_to(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[tuple[tuple[Any, ...], dict[str, Any]]] = []
    monkeypatch.setattr(fast_io, "create_subscription", lambda *words, **more: asked.append((words, more)))
    refusals, learn = Refusals(lambda _: None), partial(from_msgs.joint_samples, joints=NAMES)
    for actual, shown in ((None, "joint_states"), ("left/joint_states", "left/joint_states")):
        delivered: list[JointSample] = []
        fast_io.create_receiver(
            None, "joint_states", JOINT_FIELDS, learn, delivered.append, refusals, depth=3, reliable=True,
            actual_name=actual,
        )  # fmt: skip
        (_, name, take), more = asked.pop()
        assert (name, more) == ("joint_states", {"depth": 3, "reliable": True, "actual_name": actual, "raw": True})
        take(joint_state(position=[1.0, 2, 3], velocity=[0.0, 0, 0], effort=[0.0, 0, 0]))
        assert len(delivered) == 1
        take(b"rubbish")
        assert refusals.counts[shown] == 1
