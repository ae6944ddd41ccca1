"""A planner's joint trajectory: the motion that the pad gets from it, and what is refused."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_msgs_py.messages.from_msgs import joint_trajectory
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.path.joint_path import JointFeed, JointPath, Points, checked
from slip_vic_controller.robot import Robot

WAY = np.array([0.04, 0.03, 0.0])


def message(names, times, values):
    points = [
        SimpleNamespace(
            positions=list(row), time_from_start=SimpleNamespace(sec=int(t), nanosec=round(1e9 * (t - int(t))))
        )
        for t, row in zip(times, values, strict=True)
    ]
    return SimpleNamespace(joint_names=list(names), points=points)


def planned(robot, q, duration_s=0.5):
    """Return what a planner would: joint positions every 50 ms of a straight, level way of the pad."""
    x, R, _ = robot.frame(q)
    times = np.linspace(0.0, duration_s, round(duration_s / 0.05) + 1)
    rows = []
    for u in times / duration_s:
        for _ in range(6):
            away, J = robot.way_to(q, x + (10 * u**3 - 15 * u**4 + 6 * u**5) * WAY, R)
            q = q + np.linalg.pinv(J) @ away
        rows.append(q)
    return times, np.array(rows)


def path_of(robot, names, times, values):
    return JointPath(checked(Points(*joint_trajectory(message(names, times, values))), "joint_trajectory"), robot)


def arm():
    loaded = load_scenario("paper_planar")
    params = loaded.controller
    return Robot(loaded.urdf, params.ee_frame, params.joint_names), np.array(loaded.bridge.initial_position)


def test_feed_is_consistent_motion():
    """Twist and acceleration are the rates of the pose; the end is at rest; the pace is the governor's."""
    robot, q = arm()
    path = path_of(robot, robot.joint_names, *planned(robot, q))
    feed = JointFeed(path, 10**9, 0.001, 0.1)
    assert feed.next(0, 0.1) is None, "enough waits"
    samples = [feed.next(0, 0.0) for _ in range(502)]
    assert samples.pop() is None
    assert feed.ended
    assert samples[0].stamp_ns == 10**9
    assert np.abs(samples[-1].twist).max() < 1e-9
    places, twists = np.array([s.position for s in samples]), np.array([s.twist for s in samples])
    np.testing.assert_allclose(np.gradient(places, 1e-3, axis=0)[5:-5], twists[5:-5, :3], atol=1e-5)
    accelerations = np.array([s.acceleration for s in samples])
    np.testing.assert_allclose(np.gradient(twists, 1e-3, axis=0)[5:-5], accelerations[5:-5], atol=1e-3)


@pytest.mark.parametrize(("change", "line"), [
    (lambda n, t, v: (("elbow", *n[1:]), t, v), "joints .'elbow'"),
    (lambda n, t, v: (n, t, v[:, 1:]), "positions in point 1"),
    (lambda n, t, v: (n, t[:1], v[:1]), "1 points, expected at least 2"),
    (lambda n, t, v: (n, t * 0.0, v), "growing times"),
    (lambda n, t, v: (n, t, v * np.nan), "finite numbers"),
    (lambda n, t, v: (n, t, v + 100.0), "rad, expected"),
    (lambda n, t, v: (n, t, v + 0.1), "from the pad, expected 10 mm"),
    (lambda n, t, v: (n, 0.01 * t, v), "allow more time"),
    (lambda n, t, v: (n, [0.0, 1e-9, 2e-9, *t[3:]], v), "path: times|allow more time"),
])  # fmt: skip
def test_bad_trajectory_is_refused(change, line):
    robot, q = arm()
    names, times, values = change(robot.joint_names, *planned(robot, q))
    with pytest.raises(InputError, match=line) as refused:
        path_of(robot, names, times, values).check_motion(q, robot.velocity_limit)
    assert "\n" not in str(refused.value)
