"""The rules of a supervised bring-up: numbers in, verdict and fix out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_vic.scenarios.scenario import load_scenario
from slip_vic.setup.bringup import verdicts
from slip_vic.setup.bringup.verdicts import Heard, Track

BRINGUP = (
    "controller.trajectory.kind=goal", "controller.safety.auto_enable=false", "controller.governor.friction=unknown",
)  # fmt: skip
PARAMS = load_scenario("paper_planar", law="governed", assignments=BRINGUP).controller
WEIGHT = np.array([0.0, 0.0, -4.905])
X, Z = np.eye(3)[0], np.eye(3)[2]


def track(hz: float = 100.0, count: int = 200, late: float = 0.0, values: np.ndarray | None = None) -> Track:
    stamp = 10.0 + np.arange(count) / hz
    return Track(stamp + late, stamp, np.zeros((count, 6)) if values is None else values)


def test_wrongly_started_controller() -> None:
    assert verdicts.judge_controller(PARAMS, "HOLD: not enabled").holds
    other = load_scenario("paper_planar").controller
    assert "trajectory.kind:=goal" in verdicts.judge_controller(other, "HOLD").fix
    assert "~/hold" in verdicts.judge_controller(PARAMS, "ACTIVE").fix


@pytest.mark.parametrize(
    ("samples", "word"),
    [
        (track(count=2), "start the driver"),
        (track(hz=20.0), "rate"),
        (track(hz=300.0), "control_period_s"),
        (track(late=0.3), "clocks"),
        (track(late=-0.3), "ahead"),
        (track()._replace(stamp=np.zeros(200)), "stamp"),
        (track()._replace(stamp=np.roll(track().stamp, 1)), "two drivers"),
    ],
)
def test_slow_late_and_disordered_streams(samples: Track, word: str) -> None:
    assert verdicts.judge_stream("wrench", track(), 80.0, 120.0, 0.05, 0.05).holds
    assert word in verdicts.judge_stream("wrench", samples, 80.0, 120.0, 0.05, 0.05).fix


def test_rate_ignores_gaps() -> None:
    every, stamps = track(120.0, 600), track(120.0, 600).stamp
    heard = Track(*(np.concatenate((part[:100], part[300:350], part[580:])) for part in every))
    assert heard.rate == pytest.approx(120.0, rel=1e-6)
    rounded = np.ceil(stamps * 1000.0) / 1000.0
    assert Track(rounded, rounded, every.values).rate == pytest.approx(120.0, rel=1e-2)
    assert np.isnan(track(count=1).rate)


def test_noise_rate_and_latency() -> None:
    rng = np.random.default_rng(1)
    wrench = rng.standard_normal((2000, 6)) * (0.05, 0.05, 0.05, 0.002, 0.002, 0.002)
    slip = rng.standard_normal((200, 6)) * (1e-3, 1e-3, 0.0, 0.0, 0.0, 2e-2)
    joints = track(1000.0, 2000)
    heard = Heard(joints, track(1000.0, 2000, values=wrench), track(values=slip, late=0.01), {})
    found, offset = verdicts.measured_sensors(heard, PARAMS)
    expected = {
        "wrench_sensor.noise_force": 0.05, "wrench_sensor.noise_torque": 0.002, "slip_sensor.rate_hz": 100.0,
        "slip_sensor.latency_s": 0.01, "slip_sensor.noise_linear": 1e-3, "slip_sensor.noise_angular": 2e-2,
    }  # fmt: skip
    assert found == pytest.approx(expected, rel=0.1)
    assert verdicts.judge_rest(0.0, offset, PARAMS, found).holds
    silent, _ = verdicts.measured_sensors(Heard(joints, joints, joints, {}), PARAMS)
    assert silent == {"slip_sensor.rate_hz": 0.0, "slip_sensor.latency_s": 0.0}
    for speed, shift, force, word in (
        (0.1, 0.0, 0.0, "rest"), (0.0, 0.02, 0.0, "calibrate"), (0.0, math.nan, 0.0, "does not measure"),
        (0.0, 0.0, 0.2, "filter"),
    ):  # fmt: skip
        assert word in verdicts.judge_rest(speed, shift, PARAMS, silent | {"wrench_sensor.noise_force": force}).fix


@pytest.mark.parametrize(
    ("force", "torque", "word"),
    [
        (-WEIGHT, np.zeros(3), "wrench.sign"),
        (np.array([4.905, 0.0, 0.0]), np.zeros(3), "90 degrees"),
        (0.1 * WEIGHT, np.zeros(3), "wrench.force_scale"),
        (1.4 * WEIGHT, np.zeros(3), "wrench.tool_mass"),
        (WEIGHT + 4.0 * X, np.zeros(3), "zero it"),
        (WEIGHT, 0.5 * X, "torque_scale"),
    ],
)
def test_wrong_weights(force: np.ndarray, torque: np.ndarray, word: str) -> None:
    assert verdicts.judge_weight(1.05 * WEIGHT, np.zeros(3), WEIGHT, np.zeros(3), 0.1).holds
    assert word in verdicts.judge_weight(force, torque, WEIGHT, np.zeros(3), 0.1).fix


def test_joint_that_moves() -> None:
    names = ("shoulder", "elbow", "wrist")
    assert verdicts.judge_joint(names, 1, np.array([0.0, 0.03, 0.005])).holds
    skipped = verdicts.judge_joint(names, 1, None)
    assert skipped.holds
    assert "not turned" in str(skipped)
    for moved, word in (
        ([0.0, 0.0, 0.0], "further"), ([0.0, 0.0, 0.03], "calls elbow what the URDF calls wrist"),
        ([0.0, -0.03, 0.0], "the other one"), ([0.0, 0.03, 0.02], "coupled"),
    ):  # fmt: skip
        assert word in verdicts.judge_joint(names, 1, np.array(moved)).fix


def test_pushes_show_sign_and_axes() -> None:
    assert verdicts.judge_push("+x", np.array([3.0, 0.4, 0.0]), X).holds
    for change, word in ((0.1 * X, "no push"), (-3.0 * X, "wrench.sign"), (3.0 * Z, "wrench.rpy")):
        assert word in verdicts.judge_push("+x", change, X).fix


def test_pulls_show_sign_and_axes() -> None:
    assert verdicts.judge_pull("+x", -0.004 * X, X).holds
    for slipped, word in ((0.004 * X, "change the sign"), (0.004 * Z, "axes"), (np.zeros(3), "no slip")):
        assert word in verdicts.judge_pull("+x", slipped, X).fix


def test_bounds_of_drift_friction_and_motion() -> None:
    def drift(moved: float) -> verdicts.Verdict:
        return verdicts.judge_drift("hold", ("a", "b"), np.array([0.0, moved]), 0.02, "with stiffness")

    assert drift(-0.019).holds
    assert "effort.gravity" in drift(-0.021).fix
    assert "b moved" in drift(math.nan).measured
    assert not drift(math.nan).holds
    assert verdicts.judge_mode("enabled", "ACTIVE", "ACTIVE").holds
    assert not verdicts.judge_mode("enabled", "HOLD: slip is silent", "ACTIVE").holds
    assert verdicts.judge_friction(0.25, 0.2, 0.19, 1, "goal 3 reached", "ACTIVE").holds
    assert verdicts.judge_friction(0.25, 0.04, 0.04, 2, "goal 3 reached", "ACTIVE").fix
    refused = verdicts.judge_friction(0.25, 0.2, 0.19, 0, "goal 3 refused: not at work", "HOLD: slip is silent")
    assert "HOLD: slip is silent" in refused.measured
    assert refused.fix
    assert verdicts.judge_motion("goal 4 reached", "ACTIVE", 0.003, 0.0025, 0.003).holds
    for goal, mode, missed, slip in (
        ("goal 4 moves", "ACTIVE", 0.0, 0.0), ("goal 4 reached", "HOLD: hold requested", 0.0, 0.0),
        ("goal 4 reached", "ACTIVE", 0.02, 0.0), ("goal 4 reached", "ACTIVE", 0.0, 0.01),
    ):  # fmt: skip
        assert verdicts.judge_motion(goal, mode, missed, slip, 0.003).fix


def test_verdict_is_one_line() -> None:
    bad = verdicts.judge_push("+x", np.array([-3.0, 0.0, 0.0]), X)
    assert "\n" not in str(bad)
    assert str(bad).startswith("push +x: got force (-3.00, 0.00, 0.00) N, 180 degrees off, expected ")
    assert str(bad).endswith(bad.fix)
