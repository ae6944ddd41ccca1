"""Diagnostics say which robot, and which of its arms, they are about."""

from __future__ import annotations

from types import SimpleNamespace

from slip_description import urdf_text
from slip_vic_controller.arm.robot import Robot
from slip_vic_controller.node.publishing import WARN, StatusPublisher
from test.support.small_arm import JOINT_NAMES, small_arm_urdf


def test_the_hardware_is_robot_and_arm() -> None:
    robot = Robot(small_arm_urdf(), "ee", JOINT_NAMES).name
    assert robot == "small"
    published = []
    sink = SimpleNamespace(publish=published.append)
    for arm in ("", "left"):
        StatusPublisher(sink, robot, arm).publish(5_000_000_007, "controller: mode", WARN, "why", {"a": 1})
    (one,), (other,) = (message.status for message in published)
    assert (one.hardware_id, other.hardware_id) == ("small", "small/left")
    assert (one.name, one.message, one.level) == ("controller: mode", "why", bytes([WARN]))
    assert [(value.key, value.value) for value in one.values] == [("a", "1")]
    assert (published[0].header.stamp.sec, published[0].header.stamp.nanosec) == (5, 7)


def test_the_suites_own_robot_has_a_name() -> None:
    assert f'<robot name="{Robot(urdf_text(), "ee", JOINT_NAMES).name}"' in urdf_text()
