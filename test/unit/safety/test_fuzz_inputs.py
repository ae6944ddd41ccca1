"""Whatever arrives on a topic: the node's own decoding refuses it in one line or takes it, and the promise holds."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rclpy.serialization import deserialize_message, serialize_message

from slip_core.errors import InputError
from slip_core.topics import topic
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_msgs_py.messages import forms, from_msgs
from slip_msgs_py.qos import message_class
from slip_sim_bridge.session import BridgeSession
from slip_vic_controller.safety.effort_limiter import LONGEST_STEP_S
from slip_vic_controller.safety.modes import Request
from slip_vic_controller.session.controller import Controller
from test.campaigns.faults.monitors import CommandMonitor, Promise
from test.campaigns.faults.plan import EFFORT, JOINT, TOPICS, WRENCH
from test.campaigns.faults.trial import PERIOD_S, prepared, starts_of
from test.campaigns.faults.wire import Wire
from test.support.one_arm import OneArm

JOINTS = tuple(f"arm_joint{i}" for i in range(1, 8))
FRAME = "ee"
NS = 1_000_000_000
SETTINGS = settings(max_examples=80)
ODD = (0.0, -0.0, math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 1e-310, 1.0, -1e3)
number = st.one_of(st.floats(width=64), st.sampled_from(ODD))


WIRES = tuple(Wire(name, JOINTS, FRAME) for name in TOPICS)
wires = st.sampled_from(WIRES)


def good_bytes(name: str) -> bytes:
    """Return an ordinary message of a topic."""
    seven, six = np.linspace(-1.0, 1.0, 7), np.linspace(-1.0, 1.0, 6)
    message: Any
    if name in (JOINT, EFFORT):
        message = forms.joint_state(JOINTS).message(NS, seven, seven, seven)
    elif name == WRENCH:
        message = forms.wrench(FRAME).message(NS, six)
    else:
        message = forms.twist(FRAME).message(NS, six)
    data: bytes = serialize_message(message)
    return data


def sound(sample: Any) -> None:
    """What is delivered has the sizes that everything behind it relies on."""
    if isinstance(sample, JointSample):
        assert sample.position.shape == sample.velocity.shape == sample.effort.shape == (len(JOINTS),)
    elif isinstance(sample, WrenchSample):
        assert sample.wrench.shape == (6,)
    elif isinstance(sample, SlipSample):
        assert sample.twist.shape == (6,)
        assert sample.valid == np.isfinite(sample.twist).all()
    else:
        assert sample.numbers.shape in ((0,), (len(JOINTS),))


@given(
    wire=wires, cuts=st.lists(st.tuples(st.floats(0.0, 0.999), st.binary(max_size=9), st.integers(0, 9)), max_size=5)
)
@SETTINGS
def test_damaged_bytes(wire: Wire, cuts: list[tuple[float, bytes, int]]) -> None:
    """Bytes that are nearly a message get far into the decoder, and into its fast path."""
    data = bytearray(good_bytes(wire.name))
    assert wire.receive(bytes(data)) is not None
    for place, new, removed in cuts:
        at = int(place * len(data))
        data[at : at + removed] = new
    sample = wire.receive(bytes(data))
    if sample is not None:
        sound(sample)


def refused_or_taken(action: Callable[[], Any]) -> Any | None:
    """Return what an action returns, None where it refuses in one line; any other exception is a crash."""
    line = ""
    try:
        return action()
    except InputError as error:
        line = str(error)
    assert "\n" not in line
    return None


@given(
    values=st.lists(number, min_size=19, max_size=19),
    parts=st.tuples(st.booleans(), st.booleans(), st.booleans(), st.booleans()),
)
@SETTINGS
def test_reference(values: list[float], parts: tuple[bool, bool, bool, bool]) -> None:
    from geometry_msgs.msg import Transform, Twist
    from trajectory_msgs.msg import MultiDOFJointTrajectoryPoint

    message = message_class(topic("reference").type)()
    if parts[0]:
        point = MultiDOFJointTrajectoryPoint()
        if parts[1]:
            pose = Transform()
            pose.translation.x, pose.translation.y, pose.translation.z = values[:3]
            pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w = values[3:7]
            point.transforms = [pose]
        for wanted, field, offset in ((parts[2], "velocities", 7), (parts[3], "accelerations", 13)):
            if wanted:
                twist = Twist()
                twist.linear.x, twist.linear.y, twist.linear.z = values[offset : offset + 3]
                setattr(point, field, [twist])
        message.points = [point]
    message = deserialize_message(serialize_message(message), type(message))
    reference = refused_or_taken(lambda: from_msgs.cartesian_reference(message))
    if reference is not None:
        assert reference.rotation.shape == (3, 3)
        assert reference.twist.shape == (6,)


# -- the session behind the topics ----------------------------------------------------------------

wild = arrays(float, 7, elements=number)
steps = st.lists(
    st.tuples(
        st.sampled_from(("good", "joint", "wrench", "slip", "pause", "request", "watchdog", "reference")),
        st.one_of(st.just(None), wild),
        st.integers(-3 * 10**9, 3 * 10**9),
    ),
    min_size=1,
    max_size=25,
)


@given(first_bad=st.booleans(), sequence=steps)
@settings(max_examples=60)
def test_session_keeps_command_limits(first_bad: bool, sequence: list[tuple[str, Any, int]]) -> None:
    """From the very first sample on, which may be bad as well."""
    scenario, law = prepared("paper_planar", True, "vic")
    safety = law.first.params.safety
    rate, pause_s = safety.limits.effort_rate, safety.inputs.age_s
    promise = Promise(law.first.robot.effort_limit, rate, LONGEST_STEP_S, pause_s, PERIOD_S)
    _run(scenario, law, CommandMonitor(promise), first_bad, sequence)


def _run(
    scenario: Any, law: Controller, monitor: CommandMonitor, first_bad: bool, sequence: list[tuple[str, Any, int]]
) -> None:
    bridge = BridgeSession(scenario.bridges, scenario.urdfs)
    bridge.start_at(1000 * NS)
    session = OneArm(law)
    now_ns = 5 * NS
    bad_first = [("joint", np.full(7, np.nan), 0)] if first_bad else []
    for kind, values, passed in [*bad_first, *sequence, ("good", None, 0), ("good", None, 0)]:
        now_ns += round(1e9 * PERIOD_S) + (max(passed, 0) if kind == "pause" else 0)
        outputs = bridge.observe()
        joint = outputs.arms[0].joint
        wild7 = np.zeros(7) if values is None else values
        stamp_ns = joint.stamp_ns + (0 if values is None else passed)
        if kind == "joint":
            joint = JointSample(stamp_ns, wild7, joint.velocity if passed % 2 else wild7[::-1].copy(), wild7)
        elif kind == "wrench":
            session.add_wrench(0, WrenchSample(stamp_ns, wild7[:6]), now_ns)
        elif kind == "slip":
            session.add_slip(0, from_msgs.slip_sample(stamp_ns, wild7[:6]), now_ns)
        elif kind == "request":
            session.request(Request(abs(passed) % 4))
        for wrench in outputs.arms[0].wrenches:
            session.add_wrench(0, wrench, now_ns)
        for slip in outputs.arms[0].slips:
            session.add_slip(0, slip, now_ns)
        session.add_joint(joint, now_ns)
        results = [session.cycle(now_ns)] if kind != "watchdog" else []
        results.append(session.watchdog(now_ns))
        for result in results:
            if result is not None:
                monitor.take(now_ns, result.command.numbers, partial(starts_of, session, joint), result.joint.stamp_ns)
        bridge.advance([None])
    assert monitor.violations == []
