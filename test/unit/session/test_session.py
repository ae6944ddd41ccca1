"""Manifests as they are read, and references of the object of several arms as the first pad gets them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from std_msgs.msg import Int64MultiArray

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.types import CartesianReference, DisplacementSample, JointSample, SlipSample, WrenchSample
from slip_vic.scenarios.scenario import load
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.session.session import ControllerSession, Manifest
from slip_vic_controller.sizes import ROOM
from test.support.made_up import MS, POSITION, controller_of

AXIS, SPEED, FASTER, STEP_S = np.array((0.6, 0.0, 0.8)), 0.7, -1.3, 1e-3
VELOCITY, ACCELERATION = np.array((0.2, -0.1, 0.3)), np.array((-0.5, 0.4, 0.1))


def object_at(t: float) -> tuple[Array, Array]:
    """Return position and attitude of an object that turns about an axis, faster and faster."""
    turn = Rotation.from_rotvec((0.4 + SPEED * t + 0.5 * FASTER * t * t) * AXIS)
    return np.array((0.5, 0.1, 0.4)) + VELOCITY * t + 0.5 * ACCELERATION * t * t, turn.as_matrix()


def two_arms() -> ControllerSession:
    scenario = load("pane_two_arms_upright", law="vic")
    return ControllerSession(Controller(scenario.controllers, scenario.placed, lockstep=True))


def test_samples_of_a_pad_reach_both_arms() -> None:
    session, nan = two_arms(), np.full(6, np.nan)
    left, right = session.arms
    right.add_wrench(0, WrenchSample(5, nan))
    left.add_slip(0, SlipSample(5, nan, valid=False))
    for stamp_ns in (6, 8):
        left.add_displacement(0, DisplacementSample(stamp_ns, np.eye(7)[6]))
    left.set_publishers({"wrench": 2, "slip_velocity": 1}, 1)
    right.set_publishers({"wrench": 1}, 2)
    assert (session.wrench_counts, session.slip_counts) == ([0, 1], [3, 0])
    heard = [arm.state.slip_inputs[k] for k, arm in enumerate((left, right))]
    assert [(of.stamp_ns, of.arrival_ns) for of in heard] == [(7, 8), (7, 8)], "between both, when the second came"
    assert left.counts() == {"wrench of contact 1 not_finite": 1, "slip invalid": 1, "wrench second_publisher": 1}
    own = {"wrench not_finite": 1, "slip of contact 1 invalid": 1}
    assert right.counts() == own | {"effort command foreign_command": 1}


def test_efforts_that_are_none_for_each_joint_are_unknown() -> None:
    (arm,) = ControllerSession(controller_of()).arms
    for stamp_ns, effort, known in ((5, np.ones(7), True), (6, np.ones(6), False), (7, np.zeros(0), False)):
        arm.add_joint(JointSample(stamp_ns, POSITION, np.zeros(7), effort))
        assert np.isfinite(arm.state.joint.answers.effort[:7]).all() == known


def test_a_replay_gives_the_samples_of_a_cycle() -> None:
    (arm,), ones, delay_ns = ControllerSession(controller_of(slip_delay_s=0.01)).arms, np.ones(6), 10 * MS
    slips = [SlipSample(k, k * ones) for k in range(ROOM + 2)]
    arm.give(JointSample(9, np.ones(7), np.ones(7), np.zeros(0)), [WrenchSample(3, 3.0 * ones)], slips[4:5], slips)
    state = arm.state
    queued = [(of.stamp_ns + delay_ns, of.twist[5]) for of in state.queue.samples]
    assert (int(state.queue.count), queued) == (ROOM, [(k, k) for k in range(2, ROOM + 2)])
    for of, k in ((state.wrench_inputs[0], 3), (state.slip_inputs[0], 4)):
        assert (of.seen, of.stamp_ns, of.values.tolist()) == (1, k, [k] * 6)
    answers = state.joint.answers
    assert (answers.stamp_ns, bool(np.isnan(answers.effort[:7]).all())) == (9, True)


def test_a_pad_moves_with_the_object_that_it_holds() -> None:
    session = two_arms()
    (position, rotation), contacts = object_at(0.0), session.controller.first.params.contacts
    motion = np.concatenate((VELOCITY, SPEED * AXIS)), np.concatenate((ACCELERATION, FASTER * AXIS))
    session.set_reference(CartesianReference(position, rotation, *motion))
    places = [x + R @ np.array(contacts.position[:3]) for x, R in map(object_at, (-STEP_S, 0.0, STEP_S))]
    given = session.task.reference
    assert (session.task.taken, session.task.reference_known) == (1, 1)
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
