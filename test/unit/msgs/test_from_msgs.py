"""What is made of messages: values in the controller's order, what is left out, and what is refused in one line."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Quaternion, Transform, Twist, Vector3
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import (
    JointTrajectory,
    JointTrajectoryPoint,
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
)

from slip_core.errors import InputError
from slip_msgs_py.messages.from_msgs import (
    cartesian_reference,
    displacement_sample,
    flag_samples,
    in_frame,
    joint_commands,
    joint_indices,
    joint_samples,
    joint_trajectory,
    pose_goal,
    slip_flag,
    slip_sample,
    streamed_reference,
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
        sample = joint_samples(message, ("a", "b"))(7, given, given, given)
        for values in (sample.position, sample.velocity, sample.effort):
            np.testing.assert_array_equal(values, (1.0, 2.0))
    whole = {"name": list(ORDER), "position": [0.0] * 3, "velocity": [0.0] * 3}
    for name in ("position", "velocity"):
        with pytest.raises(InputError, match="one position per name, and one velocity or none"):
            joint_samples(JointState(**{**whole, name: [0.0] * 2}), ORDER)


def test_velocities_that_a_joint_state_leaves_out_are_no_numbers() -> None:
    message = JointState(name=list(ORDER), position=[1.0, 2.0, 3.0])
    sample = joint_samples(message, ORDER)(7, np.array([1.0, 2.0, 3.0]), np.zeros(0), np.zeros(0))
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
        message = JointState(name=list(names), **{interface: sets[interface].tolist()})
        command = joint_commands(message, ORDER, interface)(5, sets["position"], sets["velocity"], sets["effort"])
        np.testing.assert_array_equal(command.numbers, first + np.arange(3.0))
        assert command.stamp_ns == 5
        none = joint_commands(JointState(name=list(names)), ORDER, interface)(5, *(np.zeros(0),) * 3)
        assert len(none.numbers) == 0
        with pytest.raises(InputError, match="one number per name"):
            joint_commands(JointState(name=list(names), **{interface: [0.0]}), ORDER, interface)


def test_names_that_are_not_those_of_the_joints_are_refused() -> None:
    for names in (("a", "b"), ("a", "b", "d"), ("a", "b", "b"), ("a", "b", "c", "c")):
        with pytest.raises(InputError, match="joint state: joint"):
            joint_indices(ORDER, tuple(names))


def test_slip_that_is_not_finite_or_no_pose_is_invalid() -> None:
    for k in range(7):
        broken = np.ones(7)
        broken[k] = NAN
        assert k == 6 or not slip_sample(1, broken[:6]).valid
        assert not displacement_sample(1, broken).valid
    assert slip_sample(1, np.ones(6)).valid
    for quat, valid in (((0.0, 0.0, 0.0, 1.0), True), (QUAT, True), ((1.0, 0.0, 0.0, 0.0), True), ((0.0,) * 4, False)):
        assert displacement_sample(1, np.array([0.0, 0.0, 0.0, *quat])).valid == valid


def test_one_flag_that_is_up_is_slip_and_what_is_not_known_is_no_rest() -> None:
    for flags, up, valid in (
        ((0.0, 1.0), 1.0, True), ((0.0, 0.0), 0.0, True), ((NAN, 0.0), 0.0, True), ((NAN, 1.0), 1.0, True),
        ((NAN, NAN), 0.0, False), ((), 0.0, False),
    ):  # fmt: skip
        sample = slip_flag(9, np.array(flags))
        assert (sample.stamp_ns, sample.valid) == (9, valid)
        assert not valid or sample.twist.tolist() == [up] * 6
    with pytest.raises(InputError, match="2 names, 1 positions"):
        flag_samples(JointState(name=["a", "b"], position=[0.0]))


def test_a_message_of_another_frame_is_refused_and_one_without_is_not() -> None:
    for frame in ("", "ee"):
        message = JointState(header=Header(frame_id=frame))
        assert in_frame(message, frame="ee", make=slip_sample) is slip_sample
    with pytest.raises(InputError, match="frame_id"):
        in_frame(JointState(header=Header(frame_id="base")), frame="ee", make=slip_sample)


def test_a_joint_trajectory_is_its_times_positions_and_names() -> None:
    points = [
        JointTrajectoryPoint(positions=[1.0 * k, k + 0.5], time_from_start=Duration(sec=k, nanosec=250_000_000))
        for k in range(3)
    ]
    times, positions, names = joint_trajectory(JointTrajectory(joint_names=["a", "b"], points=points))
    np.testing.assert_allclose(times, (0.25, 1.25, 2.25), rtol=ROUNDING)
    np.testing.assert_array_equal(positions, [[0.0, 0.5], [1.0, 1.5], [2.0, 2.5]])
    assert names == ("a", "b")
    with pytest.raises(InputError, match="1 positions in point 2"):
        joint_trajectory(
            JointTrajectory(joint_names=["a", "b"], points=[points[0], JointTrajectoryPoint(positions=[1.0])])
        )
