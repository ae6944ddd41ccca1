"""`/tf` by the bridge, where a full ROS is installed: the links of the arm and the object, 50 times a second."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from slip_core.errors import InputError
from slip_core.files.link_tree import poses_on_parents, read_links
from slip_core.types import ObjectTruth
from slip_msgs_py.messages import to_msgs
from slip_msgs_py.messages.transforms import TransformEncoder
from slip_msgs_py.qos import create_publisher

PERIOD_NS: Final = 20_000_000


class FramePublisher:
    """Publishes where everything is.

    Args:
        node: the bridge; its namespace is the prefix of the arm's frames.
        urdf: the arm.

    Raises:
        InputError: the package tf2_msgs is not installed.
    """

    def __init__(self, node: Any, urdf: str) -> None:
        try:
            self._publisher = create_publisher(node, "/tf")
        except ModuleNotFoundError:
            expected = "the package tf2_msgs of a full ROS 2 (apt install ros-jazzy-tf2-msgs)"
            raise InputError("parameter publish_tf", got="no tf2_msgs", expected=expected) from None
        self._links = read_links(urdf)
        prefix = node.get_namespace().strip("/")
        prefix = f"{prefix}/" if prefix else ""
        names = [prefix + link.name for link in self._links]
        parents = [names[link.parent] if link.parent >= 0 else to_msgs.WORLD for link in self._links]
        self._encoder = TransformEncoder([*zip(parents, names, strict=True), (to_msgs.WORLD, to_msgs.OBJECT)])
        self._joints = node.params.joint_names
        self._next_ns = 0

    def publish(self, stamp_ns: int, joints: Any, truth: ObjectTruth) -> None:
        """Publish, if it is time; joints (n,) [rad]."""
        if self._next_ns - PERIOD_NS <= stamp_ns < self._next_ns:
            return
        self._next_ns = stamp_ns + PERIOD_NS
        arm = poses_on_parents(self._links, dict(zip(self._joints, joints.tolist(), strict=True)))
        thing = to_msgs.odometry_numbers(truth)[0]
        self._publisher.publish(self._encoder.encode(stamp_ns, np.vstack([arm, thing])))
