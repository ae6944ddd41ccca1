"""Transforms as this package writes them, read by an independent decoder."""

from __future__ import annotations

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from slip_msgs_py.messages.transforms import TYPE, TransformEncoder

STORE = get_typestore(Stores.ROS2_JAZZY)
NS = 10**9


@pytest.mark.parametrize("count", range(5))
def test_names_of_every_length_stamps_and_poses_come_back(count: int) -> None:
    frames = [("p" * (k % 4 + 1), "c" * (k // 4 + 3 * k % 5)) for k in range(4 * count)]
    encoder, rng = TransformEncoder(frames), np.random.default_rng(count)
    for stamp_ns in (7 * NS + 5, 0, (2**31 - 1) * NS + NS - 1):
        poses = rng.normal(size=(len(frames), 7))
        data = encoder.encode(stamp_ns, poses)
        message = STORE.deserialize_cdr(data, TYPE)
        assert [(each.header.frame_id, each.child_frame_id) for each in message.transforms] == frames
        for each, pose in zip(message.transforms, poses, strict=True):
            assert each.header.stamp.sec * NS + each.header.stamp.nanosec == stamp_ns
            moved, turned = each.transform.translation, each.transform.rotation
            assert [moved.x, moved.y, moved.z, turned.x, turned.y, turned.z, turned.w] == pose.tolist()
        assert data == bytes(STORE.serialize_cdr(message, TYPE)), "padding is zero, and nothing comes behind"
