"""Where fields lie in a typed message: against rclpy's own encoder, and what is no plain message."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Transform, Twist, Vector3, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, Image, JointState, MultiDOFJointState
from std_msgs.msg import Bool, Empty, Float32MultiArray, Header, MultiArrayDimension, MultiArrayLayout
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

from slip_msgs_py.messages.cdr import numbers_at
from slip_msgs_py.messages.layout import layout_of

CODES = {
    "boolean": "?", "double": "f8", "float": "f4", "uint8": "u1", "int32": "i4", "uint32": "u4"
}  # fmt: skip
MOVED = MultiDOFJointTrajectoryPoint(
    transforms=[Transform(translation=Vector3(x=1.0))] * 2, velocities=[Twist(angular=Vector3(z=-2.0))]
)
MESSAGES = [
    Bool(data=True),
    JointState(header=Header(frame_id="näme"), name=["", "a", "bcd"], position=[0.5, -1.5], effort=[7.0]),
    Odometry(header=Header(frame_id="w"), child_frame_id="object"),
    MultiDOFJointTrajectory(joint_names=["j"], points=[MOVED, MultiDOFJointTrajectoryPoint(), MOVED]),
    MultiDOFJointState(joint_names=["ab"], transforms=[Transform(translation=Vector3(y=3.0))]),
    Float32MultiArray(
        layout=MultiArrayLayout(dim=[MultiArrayDimension(label="abc", size=3, stride=2)]), data=[1.5, 2.5, -3.5]
    ),
    Image(height=2, encoding="mono8", is_bigendian=1, data=[9, 8, 7]),
    CameraInfo(width=7, d=[0.25] * 5, k=np.arange(9.0), binning_x=3),
]


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: type(message).__name__)
def test_numbers_are_where_rclpy_writes_them(message: Any) -> None:
    data, layout = bytes(serialize_message(message)), layout_of(message)
    assert layout.length <= len(data)  # rclpy leaves slack behind an empty sequence
    for leaf in layout.leaves:
        found = np.frombuffer(data, f"<{CODES[leaf.kind]}", leaf.count, leaf.offset).tolist()
        owner: Any = message
        *path, name = leaf.path.replace("[", ".[").split(".")
        for step in path:
            owner = owner[int(step[1:-1])] if step.startswith("[") else getattr(owner, step)
        assert found == numbers_at(owner, name), leaf.path


@pytest.mark.parametrize(("frame", "padding"), [("", [17, 18, 19]), ("ab", [19]), ("abcd", [*range(21, 28)])])
def test_padding_aligns_a_number_to_its_size(frame: str, padding: list[int]) -> None:
    layout = layout_of(WrenchStamped(header=Header(frame_id=frame)))
    assert layout.padding == padding
    assert layout.length == len(serialize_message(WrenchStamped(header=Header(frame_id=frame))))


def test_an_empty_message_has_one_byte() -> None:
    assert layout_of(Empty()).length == 5


def test_wide_strings_are_refused() -> None:
    message = SimpleNamespace(a="x", get_fields_and_field_types=lambda: {"a": "wstring"})
    with pytest.raises(ValueError, match="a: wstring"):
        layout_of(message)
