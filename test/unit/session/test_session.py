"""Manifests as they are read, and references of the object of several arms as the first pad gets them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from std_msgs.msg import Int64MultiArray

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.types import CartesianReference
from slip_vic.scenarios.scenario import load
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.session.session import ControllerSession, Manifest

AXIS, SPEED, FASTER, STEP_S = np.array((0.6, 0.0, 0.8)), 0.7, -1.3, 1e-3
VELOCITY, ACCELERATION = np.array((0.2, -0.1, 0.3)), np.array((-0.5, 0.4, 0.1))


def object_at(t: float) -> tuple[Array, Array]:
    """Return position and attitude of an object that turns about an axis, faster and faster."""
    turn = Rotation.from_rotvec((0.4 + SPEED * t + 0.5 * FASTER * t * t) * AXIS)
    return np.array((0.5, 0.1, 0.4)) + VELOCITY * t + 0.5 * ACCELERATION * t * t, turn.as_matrix()


def test_a_pad_moves_with_the_object_that_it_holds() -> None:
    scenario = load("pane_two_arms_upright", law="vic")
    session = ControllerSession(Controller(scenario.controllers, scenario.placed, lockstep=True))
    (position, rotation), contacts = object_at(0.0), session.controller.first.params.contacts
    motion = np.concatenate((VELOCITY, SPEED * AXIS)), np.concatenate((ACCELERATION, FASTER * AXIS))
    session.set_reference(CartesianReference(position, rotation, *motion))
    places = [x + R @ np.array(contacts.position[:3]) for x, R in map(object_at, (-STEP_S, 0.0, STEP_S))]
    given = session.task.reference
    np.testing.assert_allclose(given.position, places[1], atol=1e-15)
    np.testing.assert_allclose(given.rotation, rotation @ matrix_from_quat_xyzw(contacts.orientation_xyzw[:4]))
    np.testing.assert_allclose(given.twist[:3], (places[2] - places[0]) / (2.0 * STEP_S), atol=1e-6)
    np.testing.assert_allclose(given.acceleration[:3], (places[2] - 2.0 * places[1] + places[0]) / STEP_S**2, atol=1e-6)
    np.testing.assert_array_equal(given.twist[3:], motion[0][3:])
    np.testing.assert_array_equal(given.acceleration[3:], motion[1][3:])


def test_numbers_have_their_places() -> None:
    found = Manifest.decode(Int64MultiArray(data=[7, 3, 5, 11, 12, 21, 22]))
    assert found == Manifest(tick=7, stamp_ns=3_000_000_005, wrench_counts=(11, 21), slip_counts=(12, 22))
    assert Manifest.decode(Int64MultiArray(data=[7, 3, 5, 11, 12])).slip_counts == (12,)


@pytest.mark.parametrize("size", [0, 3, 4, 6, 8])
def test_another_length_is_refused(size: int) -> None:
    with pytest.raises(InputError, match=f"got {size} numbers"):
        Manifest.decode(Int64MultiArray(data=range(size)))
