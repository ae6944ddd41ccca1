"""Compiled poses and odometry against their plain forms, at every branch of the quaternion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slip_msgs_py.messages import to_msgs
from test.referees.arrays import rotate6

SAME = 4e-15  # a few roundings of numbers of size 1
HALF_TURNS = [np.diag(signs) for signs in ((1.0, 1, 1), (1.0, -1, -1), (-1.0, 1, -1), (-1.0, -1, 1))]
BETWEEN = [  # two or three equal elements
    Rotation.from_rotvec(np.pi * np.array(axis) / np.linalg.norm(axis)).as_matrix()
    for axis in ((1.0, 1, 0), (1, 0, 1), (0, 1, 1), (1, 1, 1), (1, -1, 0))
]
DRAWN = list(Rotation.random(200, np.random.default_rng(4)).as_matrix())


@pytest.mark.parametrize("rotations", [HALF_TURNS, BETWEEN, DRAWN], ids=["half turns", "between", "drawn"])
def test_numbers_of_poses_and_odometry_are_the_plain_ones(rotations: list[np.ndarray]) -> None:
    rng, largest = np.random.default_rng(5), set()
    for R in rotations:
        position, twist = rng.standard_normal(3), rng.standard_normal(6)
        pose, turned = to_msgs.odometry_numbers(position, R, twist)
        quat = Rotation.from_matrix(R).as_quat()
        expected = np.concatenate((position, np.copysign(1.0, quat @ pose[3:]) * quat))
        assert pose[6] >= 0.0
        for got in (pose, to_msgs.pose_numbers(position, R), to_msgs.pose_numbers(position, np.asfortranarray(R))):
            np.testing.assert_allclose(got, expected, rtol=0, atol=SAME)
        np.testing.assert_allclose(turned, rotate6(R.T, twist), rtol=0, atol=SAME)
        largest.add(int(np.abs(expected[3:]).argmax()))
    assert largest == {0, 1, 2, 3} or rotations is BETWEEN
