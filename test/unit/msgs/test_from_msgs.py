"""What is made of messages: values in the controller's order, what is left out, and what is refused in one line."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import PoseStamped, Quaternion, Transform, Twist, TwistStamped, Vector3, Wrench, WrenchStamped
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from slip_core.errors import InputError
from slip_msgs_py.messages import to_msgs
from slip_msgs_py.messages.from_msgs import (
    cartesian_reference,
    joint_command,
    joint_indices,
    joint_sample,
    pose_goal,
    slip_displacement,
    slip_flags,
    slip_velocity,
    streamed_reference,
    wrench_sample,
)

ROUNDING = 1e-12
POSITION, QUAT = (0.1, -0.2, 0.3), (0.5, 0.1, -0.7, 0.2)
TWIST, ACCELERATION = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (-1.0, -2.0, -3.0, -4.0, -5.0, -6.0)
NAN = math.nan
ORDER = ("a", "b", "c")


def six(values: tuple[float, ...] | None) -> list[Twist]:
    if values is None:
        return []
    parts = [dict(zip("xyz", map(float, half), strict=True)) for half in (values[:3], values[3:])]
    return [Twist(linear=Vector3(**parts[0]), angular=Vector3(**parts[1]))]


def reference(position=POSITION, quat=QUAT, twist=None, acceleration=None, after_ns=0, frame="world") -> Any:
    place = Vector3(**dict(zip("xyz", map(float, position), strict=True)))
    turn = Quaternion(**dict(zip("xyzw", map(float, quat), strict=True)))
    point = MultiDOFJointTrajectoryPoint(
        transforms=[Transform(translation=place, rotation=turn)], velocities=six(twist),
        accelerations=six(acceleration), time_from_start=Duration(sec=after_ns // 10**9, nanosec=after_ns % 10**9),
    )  # fmt: skip
    return MultiDOFJointTrajectory(header=Header(stamp=Time(sec=3, nanosec=4), frame_id=frame), points=[point])


def test_a_reference_is_the_pose_and_what_is_left_out_is_zero() -> None:
    for twist, acceleration in ((None, None), (TWIST, None), (None, ACCELERATION), (TWIST, ACCELERATION)):
        made = cartesian_reference(reference(twist=twist, acceleration=acceleration))
        np.testing.assert_array_equal(made.position, POSITION)
        np.testing.assert_allclose(made.rotation, Rotation.from_quat(QUAT).as_matrix(), atol=ROUNDING)
        np.testing.assert_array_equal(made.twist, twist or np.zeros(6))
        np.testing.assert_array_equal(made.acceleration, acceleration or np.zeros(6))
        assert made.stamp_ns == 3 * 10**9 + 4


def test_a_reference_without_a_pose_is_refused() -> None:
    empty = reference()
    empty.points[0].transforms = []
    for message in (empty, MultiDOFJointTrajectory()):
        with pytest.raises(InputError, match="no point with a transform"):
            cartesian_reference(message)
    for quat in ((0.0, 0.0, 0.0, 0.0), (NAN, 0.0, 0.0, 1.0)):
        with pytest.raises(InputError, match="quaternion"):
            cartesian_reference(reference(quat=quat))


def test_a_stream_says_how_it_moves_in_finite_numbers() -> None:
    made = streamed_reference(reference(twist=TWIST, acceleration=ACCELERATION))
    np.testing.assert_array_equal(made.twist, TWIST)
    np.testing.assert_array_equal(made.acceleration, ACCELERATION)
    for left_out in ({}, {"twist": TWIST}, {"acceleration": ACCELERATION}):
        with pytest.raises(InputError, match="a pose alone"):
            streamed_reference(reference(**left_out))
    whole = {"position": POSITION, "twist": TWIST, "acceleration": ACCELERATION}
    for name, value in whole.items():
        with pytest.raises(InputError, match="not finite"):
            streamed_reference(reference(**{**whole, name: (*value[:-1], NAN)}))


def test_a_goal_is_a_pose_at_rest_after_its_duration() -> None:
    for after_ns, duration in ((1_500_000_000, 1.5), (0, 2.5)):
        goal = pose_goal(reference(after_ns=after_ns), 2.5)
        np.testing.assert_array_equal(goal.position, POSITION)
        np.testing.assert_allclose(goal.rotation, Rotation.from_quat(QUAT).as_matrix(), atol=ROUNDING)
        assert goal.duration_s == pytest.approx(duration, rel=ROUNDING)
        again = pose_goal(to_msgs.goal(goal.position, goal.rotation, duration), 0.0)
        assert (tuple(again.position), again.duration_s) == (POSITION, goal.duration_s)
        np.testing.assert_allclose(again.rotation, goal.rotation, atol=ROUNDING)
    assert pose_goal(reference(frame="", twist=(0.0,) * 6), 1.0).duration_s == 1.0


def test_a_goal_that_is_none_is_refused() -> None:
    two = reference()
    two.points = [*two.points, *two.points]
    for message, default_s, said in (
        (two, 1.0, "2 points"), (MultiDOFJointTrajectory(), 1.0, "0 points"),
        (reference(frame="base"), 1.0, "frame_id"), (reference(position=(0.0, NAN, 0.0)), 1.0, "position"),
        (reference(twist=TWIST), 1.0, "a motion"),
        (reference(acceleration=ACCELERATION), 1.0, "a motion"), (reference(), 0.0, "more than 0"),
        (reference(after_ns=-1_000_000_000), 1.0, "more than 0"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=said):
            pose_goal(message, default_s)


def test_joints_beyond_those_of_the_controller_are_left_out() -> None:
    for names in (("a", "b", "c"), ("c", "a", "b")):  # more joints than the controller's
        given = np.array([{"a": 1.0, "b": 2.0, "c": 3.0}[name] for name in names])
        message = JointState(name=list(names), position=given.tolist(), velocity=given.tolist(), effort=given.tolist())
        sample = joint_sample(message, ("a", "b"))
        for values in (sample.position, sample.velocity, sample.effort):
            np.testing.assert_array_equal(values, (1.0, 2.0))
    whole = {"name": list(ORDER), "position": [0.0] * 3, "velocity": [0.0] * 3}
    for name in ("position", "velocity"):
        with pytest.raises(InputError, match="one position per name, and one velocity or none"):
            joint_sample(JointState(**{**whole, name: [0.0] * 2}), ORDER)


def test_velocities_that_a_joint_state_leaves_out_are_no_numbers() -> None:
    message = JointState(name=list(ORDER), position=[1.0, 2.0, 3.0])
    sample = joint_sample(message, ORDER)
    np.testing.assert_array_equal(sample.position, (1.0, 2.0, 3.0))
    assert np.isnan(sample.velocity).all()
    assert sample.velocity.shape == (3,)


def test_of_a_command_its_interface_counts_alone() -> None:
    names = ("c", "a", "b")
    sets = {
        "position": np.array([3.0, 1.0, 2.0]),
        "velocity": np.array([6.0, 4.0, 5.0]),
        "effort": np.array([9.0, 7.0, 8.0]),
    }
    for interface, first in (("position", 1.0), ("velocity", 4.0), ("effort", 7.0)):
        message = JointState(name=list(names), **{kind: values.tolist() for kind, values in sets.items()})
        message.header.stamp.nanosec = 5
        command = joint_command(message, ORDER, interface)
        np.testing.assert_array_equal(command.numbers, first + np.arange(3.0))
        assert command.stamp_ns == 5
        none = joint_command(JointState(name=list(names)), ORDER, interface)
        assert len(none.numbers) == 0
        with pytest.raises(InputError, match="one number per name"):
            joint_command(JointState(name=list(names), **{interface: [0.0]}), ORDER, interface)


def test_names_that_are_not_those_of_the_joints_are_refused() -> None:
    for names in (("a", "b"), ("a", "b", "d"), ("a", "b", "b"), ("a", "b", "c", "c")):
        with pytest.raises(InputError, match="joint state: joint"):
            joint_indices(ORDER, tuple(names))


def pose_of(numbers: Any) -> PoseStamped:
    message = PoseStamped()
    for owner, values in ((message.pose.position, numbers[:3]), (message.pose.orientation, numbers[3:])):
        for name, value in zip("xyzw", map(float, values), strict=False):
            setattr(owner, name, value)
    return message


def test_slip_that_is_not_finite_or_no_pose_is_invalid() -> None:
    for k in range(7):
        broken = np.ones(7)
        broken[k] = NAN
        assert k == 6 or not slip_velocity(TwistStamped(twist=six(tuple(broken[:6]))[0]), "ee").valid
        assert not slip_displacement(pose_of(broken), "ee").valid
    assert slip_velocity(TwistStamped(twist=six((1.0,) * 6)[0]), "ee").valid
    for quat, valid in (((0.0, 0.0, 0.0, 1.0), True), (QUAT, True), ((1.0, 0.0, 0.0, 0.0), True), ((0.0,) * 4, False)):
        assert slip_displacement(pose_of((0.0, 0.0, 0.0, *quat)), "ee").valid == valid


def test_one_flag_that_is_up_is_slip_and_what_is_not_known_is_no_rest() -> None:
    for flags, up, valid in (
        ((0.0, 1.0), 1.0, True), ((0.0, 0.0), 0.0, True), ((NAN, 0.0), 0.0, True), ((NAN, 1.0), 1.0, True),
        ((NAN, NAN), 0.0, False), ((), 0.0, False),
    ):  # fmt: skip
        sample = slip_flags(JointState(name=["a"] * len(flags), position=flags))
        assert sample.valid == valid
        assert not valid or sample.twist.tolist() == [up] * 6
    with pytest.raises(InputError, match="2 names, 1 positions"):
        slip_flags(JointState(name=["a", "b"], position=[0.0]))


def test_a_message_of_another_frame_is_refused_and_one_without_is_not() -> None:
    kinds = (wrench_sample, WrenchStamped), (slip_velocity, TwistStamped), (slip_displacement, PoseStamped)
    for read, kind in kinds:
        for frame in ("", "ee"):
            assert read(kind(header=Header(frame_id=frame)), "ee").stamp_ns == 0
        with pytest.raises(InputError, match="frame_id"):
            read(kind(header=Header(frame_id="base")), "ee")


def test_numbers_of_wrench_twist_pose_and_flags() -> None:
    (motion,) = six(TWIST)
    wrench = Wrench(force=motion.linear, torque=motion.angular)
    assert tuple(wrench_sample(WrenchStamped(wrench=wrench), "ee").wrench) == TWIST
    assert tuple(slip_velocity(TwistStamped(twist=motion), "ee").twist) == TWIST
    assert tuple(slip_displacement(pose_of((*POSITION, *QUAT)), "ee").pose) == (*POSITION, *QUAT)
    assert slip_flags(JointState(name=["a"], position=[1.0])).twist.tolist() == [1.0] * 6
