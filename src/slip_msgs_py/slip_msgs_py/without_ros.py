"""The error of a program where ROS 2 is not installed."""

from __future__ import annotations

import importlib.util

from slip_core.errors import InputError


def check_ros() -> None:
    """Look for ROS.

    Raises:
        InputError: this Python has none.
    """
    if importlib.util.find_spec("rclpy") is None:
        raise no_ros()


def no_ros() -> InputError:
    """Return the error of a Python without ROS, with its fix."""
    return InputError(
        "ROS 2", got="no rclpy in this Python", expected="ROS 2 Jazzy",
        fix="pip install '.[ros]' in a clone, or source /opt/ros/jazzy/setup.bash before the start",
    )  # fmt: skip


def is_of_ros(error: ModuleNotFoundError) -> bool:
    """Return whether a module is missing because ROS is not installed."""
    name = (error.name or "").partition(".")[0]
    ours = name.startswith(("rcl", "rosidl", "rpyutils", "builtin_interfaces", "ament_")) or name.endswith("_msgs")
    return ours and importlib.util.find_spec("rclpy") is None
