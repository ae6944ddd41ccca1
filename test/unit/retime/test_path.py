"""A path of the joints: the motion of the pad along it, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_vic.retime.path import JointPath, Points
from slip_vic.scenarios.scenario import load
from slip_vic_controller.robot import Robot

WAY = np.array([0.04, 0.03, 0.0])


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
    return JointPath(Points(np.array(times), values, tuple(names)), robot)


def arm():
    loaded = load("paper_planar", law="vic")
    params = loaded.controller
    return Robot(loaded.urdf, params.ee_frame, params.joint_names), np.array(loaded.bridge.initial_position)


def test_pad_motion_is_consistent():
    """Twist and acceleration are the rates of the pose; the end is at rest."""
    robot, q = arm()
    path = path_of(robot, robot.joint_names, *planned(robot, q))
    samples = [path.pad(t) for t in np.linspace(0.0, 0.5, 501)]
    assert np.abs(samples[-1].twist).max() < 1e-9
    places, twists = np.array([s.position for s in samples]), np.array([s.twist for s in samples])
    np.testing.assert_allclose(np.gradient(places, 1e-3, axis=0)[5:-5], twists[5:-5, :3], atol=1e-5)
    accelerations = np.array([s.acceleration for s in samples])
    np.testing.assert_allclose(np.gradient(twists, 1e-3, axis=0)[5:-5], accelerations[5:-5], atol=1e-3)


@pytest.mark.parametrize(("change", "line"), [
    (lambda n, t, v: (("elbow", *n[1:]), t, v), "joints .'elbow'"),
    (lambda n, t, v: (n, t, v + 100.0), "rad, expected"),
    (lambda n, t, v: (n, [0.0, 1e-200, 2e-200, *t[3:]], v), "path: times"),
])  # fmt: skip
def test_bad_path_is_refused(change, line):
    robot, q = arm()
    names, times, values = change(robot.joint_names, *planned(robot, q))
    with pytest.raises(InputError, match=line) as refused:
        path_of(robot, names, times, values)
    assert "\n" not in str(refused.value)
