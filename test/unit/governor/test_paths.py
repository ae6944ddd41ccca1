"""Built-in references: velocity and acceleration are the derivatives, motion begins and ends at rest, goals are met."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.params import build
from slip_vic_controller.params.controller_params import TrajectoryParams
from slip_vic_controller.path.paths import make_path
from slip_vic_controller.sizes import ROOM
from test.referees.law_referee import S, exponential
from test.support.law_cases import reference_of

STEP = 1e-5
FIRST_DIFFERENCE = 1e-7  # central differences with third derivatives up to 100
ROUNDING = 1e-10
WAYPOINTS = (0.1, 0.0, 0.05, 0.0, 0.2, 0.0, 0.2, -0.1, 0.0, 0.3, 0.2, -0.4, 0.0, 0.1, 0.1, 0.0, 0.0, 0.5)
KINDS = {
    "hold": {},
    "quintic": {"duration_s": 2.0, "displacement": (0.4, 0.3, -0.1), "rotation": (0.2, -0.5, 0.8)},
    "waypoints": {"duration_s": 3.0, "waypoints": WAYPOINTS},
    "circle": {"duration_s": 6.0, "period_s": 3.0, "radius": 0.15, "plane": "yz", "rotation": (0.0, 0.1, 0.4)},
    "lemniscate": {"duration_s": 6.0, "ramp_s": 0.8, "period_s": 3.0, "radius": 0.2, "rotation": (0.0, 0.0, 0.3)},
}
START = (np.array([0.5, -0.2, 0.3]), exponential(np.array([0.3, 2.0, -1.0])))


def path_of(kind: str):
    params = build(TrajectoryParams, {"kind": kind, **KINDS[kind]}, "test")
    path = make_path(params)
    return params, lambda t: reference_of(path, t, *START)


def test_rates_are_derivatives() -> None:
    """Checked all along the motion, knots, ramps, start and end included, where the acceleration is continuous."""
    for kind in KINDS:
        params, at = path_of(kind)
        for t in np.linspace(-0.2, params.duration_s + 0.2, 97):
            now, before, after = at(t), at(t - STEP), at(t + STEP)
            v = (after.position - before.position) / (2 * STEP)
            np.testing.assert_allclose(now.twist[:3], v, atol=FIRST_DIFFERENCE)
            spin = (after.rotation - before.rotation) / (2 * STEP) @ now.rotation.T
            np.testing.assert_allclose(S(now.twist[3:]), spin, atol=FIRST_DIFFERENCE)
            a = (after.twist - before.twist) / (2 * STEP)
            np.testing.assert_allclose(now.acceleration, a, atol=1e-3)  # jerk steps by up to 60 at the ends, times h


def test_motion_rests_at_both_ends() -> None:
    for kind in KINDS:
        params, at = path_of(kind)
        for t in (-1.0, 0.0, params.duration_s, params.duration_s + 5.0):
            reference = at(t)
            np.testing.assert_allclose(reference.twist, 0.0, atol=ROUNDING)
            np.testing.assert_allclose(reference.acceleration, 0.0, atol=1e-8)
        np.testing.assert_allclose(at(0.0).position, START[0], atol=ROUNDING)
        np.testing.assert_allclose(at(-1.0).rotation, START[1], atol=ROUNDING)


def test_quintic_ends_at_its_goal() -> None:
    params, at = path_of("quintic")
    end = at(params.duration_s)
    np.testing.assert_allclose(end.position, START[0] + params.displacement, atol=ROUNDING)
    np.testing.assert_allclose(end.rotation, exponential(np.array(params.rotation)) @ START[1], atol=ROUNDING)
    middle = at(0.5 * params.duration_s)
    np.testing.assert_allclose(middle.position, START[0] + 0.5 * np.array(params.displacement), atol=ROUNDING)


def test_waypoints_are_passed() -> None:
    _, at = path_of("waypoints")
    for k, point in enumerate(np.array(WAYPOINTS).reshape(-1, 6), start=1):
        np.testing.assert_allclose(at(float(k)).position, START[0] + point[:3], atol=ROUNDING)
        np.testing.assert_allclose(at(float(k)).rotation, exponential(point[3:]) @ START[1], atol=ROUNDING)
    assert np.abs(at(1.0).twist).max() > 0.05


def test_too_many_waypoints_are_refused() -> None:
    for count, fits in ((ROOM, True), (ROOM + 1, False)):
        params = build(TrajectoryParams, {"kind": "waypoints", "waypoints": (0.1,) * 6 * count}, "test")
        if fits:
            make_path(params)
        else:
            with pytest.raises(InputError, match="waypoints"):
                make_path(params)


def test_circle_keeps_radius_and_speed() -> None:
    params, at = path_of("circle")
    centre = START[0] + np.array([0.0, 0.0, 0.15])
    for t in np.linspace(0.0, 6.0, 61):
        offset = at(t).position - centre
        assert np.linalg.norm(offset) == pytest.approx(0.15, abs=ROUNDING)
        assert offset[0] == pytest.approx(0.0, abs=ROUNDING)
    assert np.linalg.norm(at(3.0).twist[:3]) == pytest.approx(0.15 * 2 * np.pi / params.period_s, abs=ROUNDING)


def test_lemniscate_crosses_start() -> None:
    path = make_path(build(TrajectoryParams, {"kind": "lemniscate", "duration_s": 9.0, "period_s": 4.0}, "test"))
    half = 0.5 + 0.5 * 4.0  # the ramp of 1 s costs half of itself
    at = reference_of(path, half, *START)
    np.testing.assert_allclose(at.position, START[0], atol=ROUNDING)
    assert at.twist[0] < 0.0
    assert reference_of(path, 0.5 + 1.0, *START).position[0] == pytest.approx(START[0][0] + 0.1, abs=ROUNDING)
