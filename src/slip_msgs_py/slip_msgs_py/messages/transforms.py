"""tf2_msgs/msg/TFMessage without its package, which is on no package index: its bytes."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Final

import numpy as np

from slip_core.arrays import Array
from slip_core.stamps import split_ns

TYPE: Final = "tf2_msgs/msg/TFMessage"
_HEADER_BYTES, _STAMP_BYTES, _POSE_BYTES = 4, 8, 56


class TransformEncoder:
    """Writes messages with the same frames again and again.

    Args:
        frames: (parent, child) of each transform.
    """

    def __init__(self, frames: Sequence[tuple[str, str]]) -> None:
        data, stamps, poses = bytearray(b"\x00\x01\x00\x00" + struct.pack("<I", len(frames))), [], []
        for names in frames:
            stamps.append(_padded(data, 4))
            data += bytes(_STAMP_BYTES)
            for name in names:
                text = name.encode() + b"\0"
                _padded(data, 4)
                data += struct.pack("<I", len(text)) + text
            poses.append(_padded(data, 8))
            data += bytes(_POSE_BYTES)
        self._data = np.frombuffer(bytes(data), np.uint8).copy()
        self._stamps = np.add.outer(np.array(stamps, np.int64), np.arange(_STAMP_BYTES))
        self._poses = np.add.outer(np.array(poses, np.int64), np.arange(_POSE_BYTES))

    def encode(self, stamp_ns: int, poses: Array) -> bytes:
        """Return the message in CDR; poses (n, 7): position [m], quaternion x, y, z, w of each child on its parent."""
        seconds, nanoseconds = split_ns(stamp_ns)
        stamp = np.array([seconds, nanoseconds], "<u4").view(np.uint8)
        self._data[self._stamps] = stamp
        self._data[self._poses] = np.ascontiguousarray(poses, "<f8").view(np.uint8)
        return self._data.tobytes()


def _padded(data: bytearray, size: int) -> int:
    """Align the end of a message in CDR, and return it."""
    data += bytes(-(len(data) - _HEADER_BYTES) % size)
    return len(data)
