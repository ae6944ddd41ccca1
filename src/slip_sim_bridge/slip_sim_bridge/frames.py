"""`/tf` by the bridge, where a full ROS is installed: the links of all arms and the object, 50 times a second."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from slip_core.arrays import Array
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
        node: the bridge; its namespace is a prefix of all frames of the arms, before that of the arm.
        arms: of each arm the prefix of its topics, its URDF as it stands in the world, and its joints.

    Raises:
        InputError: the package tf2_msgs is not installed.
    """

    def __init__(self, node: Any, arms: Sequence[tuple[str, str, Sequence[str]]]) -> None:
        try:
            self._publisher = create_publisher(node, "/tf")
        except ModuleNotFoundError:
            expected = "the package tf2_msgs of a full ROS 2 (apt install ros-jazzy-tf2-msgs)"
            raise InputError("parameter publish_tf", got="no tf2_msgs", expected=expected) from None
        namespace = node.get_namespace().strip("/")
        namespace = f"{namespace}/" if namespace else ""
        frames, self._arms = [], []
        for prefix, urdf, joints in arms:
            links = read_links(urdf)
            self._arms.append((links, joints))
            names = [namespace + prefix + link.name for link in links]
            parents = [names[link.parent] if link.parent >= 0 else to_msgs.WORLD for link in links]
            frames += [*zip(parents, names, strict=True)]
        self._encoder = TransformEncoder([*frames, (to_msgs.WORLD, to_msgs.OBJECT)])
        self._next_ns = 0

    def publish(self, stamp_ns: int, joints: Sequence[Array], truth: ObjectTruth) -> None:
        """Publish, if it is time; joints of each arm (n,) [rad]."""
        if self._next_ns - PERIOD_NS <= stamp_ns < self._next_ns:
            return
        self._next_ns = stamp_ns + PERIOD_NS
        poses = [
            poses_on_parents(links, dict(zip(names, positions.tolist(), strict=True)))
            for (links, names), positions in zip(self._arms, joints, strict=True)
        ]
        self._publisher.publish(self._encoder.encode(stamp_ns, np.vstack([*poses, to_msgs.odometry_numbers(truth)[0]])))
