"""tf2_msgs/msg/TFMessage without its package, which is on no package index: the schema's text and its bytes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from slip_core.arrays import Array
from slip_core.stamps import split_ns

TOPIC: Final = "/tf"
TYPE: Final = "tf2_msgs/msg/TFMessage"
TEXT: Final = "geometry_msgs/TransformStamped[] transforms\n"
"""The message's definition; its only dependency is in geometry_msgs."""
TYPE_HASH: Final = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
_STAMP_BYTES, _POSE_BYTES = 8, 56


class _TFMessage:
    """Looks to the codec like a generated message."""

    def __init__(self, transforms: list[Any]) -> None:
        self.transforms = transforms

    def get_fields_and_field_types(self) -> dict[str, str]:
        return {"transforms": "sequence<geometry_msgs/TransformStamped>"}


class TransformEncoder:
    """Writes messages with the same frames again and again.

    Args:
        frames: (parent, child) of each transform.
    """

    def __init__(self, frames: Sequence[tuple[str, str]]) -> None:
        # Names and text of the type are used without ROS, too.
        from geometry_msgs.msg import TransformStamped

        from slip_msgs_py.messages.cdr import Template

        messages = []
        for parent, child in frames:
            message = TransformStamped(child_frame_id=child)
            message.header.frame_id = parent
            messages.append(message)
        template = Template(_TFMessage(messages))
        stamps = [leaf.offset for leaf in template.leaves if leaf.path.endswith("stamp.sec")]
        poses = [leaf.offset for leaf in template.leaves if leaf.path.endswith("translation.x")]
        self._data = np.frombuffer(bytes(template.data), np.uint8).copy()
        self._stamps = np.add.outer(stamps, np.arange(_STAMP_BYTES))
        self._poses = np.add.outer(poses, np.arange(_POSE_BYTES))

    def encode(self, stamp_ns: int, poses: Array) -> bytes:
        """Return the message in CDR; poses (n, 7): position [m], quaternion x, y, z, w of each child on its parent."""
        seconds, nanoseconds = split_ns(stamp_ns)
        stamp = np.array([seconds, nanoseconds], "<u4").view(np.uint8)
        self._data[self._stamps] = stamp
        self._data[self._poses] = np.ascontiguousarray(poses, "<f8").view(np.uint8)
        return self._data.tobytes()
