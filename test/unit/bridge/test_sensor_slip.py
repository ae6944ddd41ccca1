"""What slip sensors make of the truth: digitising, faults that come and go, and the presets."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slip_core.params import build
from slip_core.types import DisplacementSample, JointSample, SlipSample, WrenchSample
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.sensors.slip import FLAG_SPEED, lifted_chip_reading, pose_of
from slip_sim_bridge.sensors.suite import SensorSuite

MS = 1_000_000
ROUNDING = 1e-12
MOVING = np.array([0.03, -0.02, 0.0, 0.0, 0.0, 0.4])


def params(**values: Any) -> BridgeParams:
    return build(BridgeParams, {f"sensors.{name.replace('__', '.')}": value for name, value in values.items()}, "test")


def readings(suite: SensorSuite, ticks: int, twist: np.ndarray = MOVING, start: int = 0) -> list[SlipSample]:
    return [s for k in range(start, start + ticks) for s in suite.slip.update(SlipSample(k * MS, twist))]


def one(**values: Any) -> np.ndarray:
    return readings(SensorSuite(params(**values)), 1)[0].twist


def test_quantum_saturation_and_dead_band() -> None:
    np.testing.assert_allclose(one(slip__quantum_linear=0.008), [0.032, -0.016, 0.0, 0.0, 0.0, 0.4], atol=ROUNDING)
    np.testing.assert_allclose(one(slip__saturation_linear=0.025)[:2], [0.025, -0.02], atol=ROUNDING)
    assert not one(slip__dead_band_linear=0.037)[:3].any()
    assert one(slip__dead_band_linear=0.035)[:2].all()
    assert one(slip__dead_band_angular=0.5)[5] == 0.0


def test_gain_bias_and_invalid() -> None:
    np.testing.assert_allclose(one(slip__faults__gain=0.8), 0.8 * MOVING, atol=ROUNDING)
    bias = (1e-3, 0.0, 0.0, 0.0, 0.0, 0.02)
    np.testing.assert_allclose(one(slip__faults__bias=bias), MOVING + bias, atol=ROUNDING)
    sample = readings(SensorSuite(params(slip__faults__invalid=True)), 1)[0]
    assert not sample.valid
    assert np.isnan(sample.twist).all()


@pytest.mark.parametrize("seed", [5])
def test_dropouts_and_outliers_come_at_their_rate(seed: int) -> None:
    ticks, share = 20_000, 0.1
    spread = 5.0 * math.sqrt(share * (1.0 - share) / ticks)  # five standard deviations of a fair count
    lost = SensorSuite(build(BridgeParams, {"seed": seed, "sensors.slip.faults.dropout_probability": share}, "test"))
    assert abs(1.0 - len(readings(lost, ticks)) / ticks - share) < spread
    wild = SensorSuite(build(BridgeParams, {"seed": seed, "sensors.slip.faults.outlier_probability": share}, "test"))
    odd = sum((sample.twist != MOVING).any() for sample in readings(wild, ticks))
    assert abs(odd / ticks - share) < spread


def test_a_fault_comes_and_goes_and_leaves_the_noise_alone() -> None:
    quiet, noisy = params(slip__noise_linear=1e-3), params(slip__noise_linear=1e-3, slip__faults__frozen=True)
    plain, faulty = SensorSuite(quiet), SensorSuite(quiet)
    before = readings(faulty, 10)
    faulty.set_faults(noisy.sensors)
    frozen = readings(faulty, 10, start=10)
    faulty.set_faults(quiet.sensors)
    after = readings(faulty, 10, start=20)
    expected = readings(plain, 30)
    assert all((a.twist == b.twist).all() for a, b in zip(before + after, expected[:10] + expected[20:], strict=True))
    assert all((sample.twist == before[-1].twist).all() for sample in frozen)
    assert [sample.stamp_ns for sample in frozen] == [k * MS for k in range(10, 20)]


def test_a_silent_sensor_publishes_nothing_rather_than_zero() -> None:
    assert readings(SensorSuite(params(slip__faults__silent=True)), 50) == []
    suite = SensorSuite(params(wrench__silent=True))
    assert suite.wrench.update(WrenchSample(0, np.ones(6))) == ()


def test_wrench_bias_and_hidden_joint_delay() -> None:
    bias = (0.1, 0.0, -0.2, 0.0, 0.0, 0.01)
    suite = SensorSuite(params(wrench__bias=bias, joint__latency_s=0.003))
    assert np.allclose(suite.wrench.update(WrenchSample(0, np.ones(6)))[0].wrench, np.ones(6) + bias)
    for k in range(10):
        sample = suite.joint.update(JointSample(k * MS, np.full(7, float(k)), np.zeros(7), np.zeros(7)))
        assert sample.stamp_ns == k * MS
    assert sample.position[0] == 6.0


def test_a_wrench_sensor_scales() -> None:
    suite = SensorSuite(params(wrench__gain=0.9))
    measured = suite.wrench.update(WrenchSample(700 * MS, np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3])))[0].wrench
    np.testing.assert_allclose(measured, 0.9 * np.array([1.0, 2.0, 3.0, 0.1, 0.2, 0.3]), atol=1e-12)


def flagged(twist: np.ndarray, **values: Any) -> SlipSample:
    settings = {f"sensors.slip.{name.replace('__', '.')}": value for name, value in values.items()}
    flag = {"slip_input": "flag", "friction.torsional_radius": 0.015, "contacts.slip_axes": [1] * 6}
    return readings(SensorSuite(build(BridgeParams, {**flag, **settings}, "test")), 1, twist)[0]


def test_a_flag_rises_where_the_pad_slides_faster_than_its_speed_turning_at_the_radius() -> None:
    for twist, speed in (
        ((0.03, 0.0, 0.04, 0.0, 0.0, 0.0), 0.05), ((0.0, 0.0, 0.0, 2.0, 0.0, 0.0), 0.03),
        ((0.012, 0.0, 0.0, 0.0, 0.0, -0.6), 0.015),
    ):  # fmt: skip
        for share, up in ((1.01, 1.0), (0.99, 0.0)):
            sample = flagged(np.array(twist) * share * FLAG_SPEED / speed)
            assert sample.valid
            assert sample.twist.tolist() == [up] * 6, "it says nothing of the direction"


def test_a_flag_is_that_of_what_the_sensor_reads_faults_included() -> None:
    slow = np.array([1.05 * FLAG_SPEED, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert not flagged(slow, faults__invalid=True).valid
    assert flagged(slow).twist.all()
    assert not flagged(slow, faults__gain=0.9).twist.any()


def places(turn: tuple[float, ...], count: int, **values: Any) -> list[DisplacementSample]:
    settings = {f"sensors.slip.{name.replace('__', '.')}": value for name, value in values.items()}
    given = {"slip_input": "displacement", "contacts.slip_axes": [1, 1, 0, 0, 0, 1], **settings}
    suite = SensorSuite(build(BridgeParams, given, "test"))
    truth = [SlipSample(k * MS, np.array(turn)) for k in range(count)]
    return [sample for each in truth for sample in suite.slip.update(each)]


def test_a_pose_is_the_translation_and_the_quaternion_of_the_rotation_vector() -> None:
    for turn in ((0.3, -1.2, 0.7), (0.0, 0.0, -3.0), (0.0, 0.6, 0.2), (1e-9, 0.0, 0.0), (0.0, 0.0, 0.0)):
        pose = pose_of(np.array([0.1, -0.2, 0.3, *turn]))
        np.testing.assert_array_equal(pose[:3], (0.1, -0.2, 0.3))
        np.testing.assert_allclose(pose[3:], Rotation.from_rotvec(turn).as_quat(), atol=ROUNDING)


def test_a_displacement_is_measured_with_noise_on_the_slip_axes_alone_and_its_faults() -> None:
    move = (0.01, 0.0, 0.0, 0.0, 0.0, 0.2)
    exact = places(move, 2)
    assert [sample.stamp_ns for sample in exact] == [0, MS]
    np.testing.assert_allclose(exact[0].pose, pose_of(np.array(move)), atol=ROUNDING)
    poses = np.array([sample.pose for sample in places(move, 2000, noise_position=1e-3)])
    turned = Rotation.from_quat(poses[:, 3:]).as_rotvec()
    spread = np.concatenate((poses[:, :3].std(axis=0), turned.std(axis=0)))
    np.testing.assert_allclose(spread, [1e-3, 1e-3, 0.0, 0.0, 0.0, 1e-3 / 0.03], rtol=0.1, atol=ROUNDING)
    np.testing.assert_allclose(poses[:, :3].mean(axis=0), move[:3], atol=1e-4)
    np.testing.assert_allclose(turned.mean(axis=0), move[3:], atol=2e-3)
    assert places(move, 50, faults__silent=True) == []
    bad = places(move, 1, faults__invalid=True)[0]
    assert not bad.valid
    assert bad.pose.shape == (7,)
    assert np.isnan(bad.pose).all()
    count, share = 2000, 0.1
    left = len(places(move, count, faults__dropout_probability=share))
    assert abs(1.0 - left / count - share) < 5.0 * math.sqrt(share * (1.0 - share) / count)


def test_a_velocity_filter_is_of_first_order_on_the_measured_positions() -> None:
    """Of a ramp from rest it reads 1 - exp(-2 pi f t) of the speed; and of positions with a quantum no less."""
    speed = np.linspace(-0.3, 0.4, 7)
    for frequency in (0.5, 20.0):
        suite = SensorSuite(params(joint__velocity_filter_hz=frequency))
        for k in range(100):
            truth = JointSample(k * MS, 1e-3 * k * speed, speed, np.ones(7))
            read = suite.joint.update(truth)
            share = 1.0 - math.exp(-2.0 * math.pi * frequency * 1e-3 * k)
            np.testing.assert_allclose(read.velocity, share * speed, atol=ROUNDING)
            np.testing.assert_array_equal(read.position, truth.position)


def test_positions_are_read_in_quanta() -> None:
    suite = SensorSuite(params(joint__quantum_position=0.02))
    read = suite.joint.update(
        JointSample(0, np.array([0.029, -0.031, 0.0, 0.011, 0.5, 1.0, -1.0]), np.zeros(7), np.zeros(7))
    )
    np.testing.assert_allclose(read.position, [0.02, -0.04, 0.0, 0.02, 0.5, 1.0, -1.0], atol=ROUNDING)


def test_each_setting_of_joint_sensors_alone_is_seen() -> None:
    still = JointSample(0, np.linspace(-1.0, 1.0, 7), np.linspace(0.5, -0.5, 7), np.ones(7))
    for values, position, velocity in (
        ({"joint__noise_position": 1e-3}, 1e-3, 0.0), ({"joint__noise_velocity": 0.02}, 0.0, 0.02),
    ):  # fmt: skip
        suite = SensorSuite(params(**values))
        reads = [suite.joint.update(still) for _ in range(500)]
        spread = [np.std([getattr(read, name) for read in reads], axis=0) for name in ("position", "velocity")]
        np.testing.assert_allclose(spread[0], position, rtol=0.2, atol=ROUNDING)
        np.testing.assert_allclose(spread[1], velocity, rtol=0.2, atol=ROUNDING)
    for rate_hz in (500.0, 0.9):
        suite, hold = SensorSuite(params(joint__rate_hz=rate_hz)), round(1000.0 / rate_hz)
        firsts = [
            suite.joint.update(JointSample(k * MS, np.full(7, float(k)), np.zeros(7), np.zeros(7))).position[0]
            for k in range(20)
        ]
        assert firsts == [k - k % hold for k in range(20)]


def test_all_chips_lifted_read_zero() -> None:
    np.testing.assert_allclose(lifted_chip_reading(MOVING, 0), MOVING, atol=ROUNDING)
    assert np.abs(lifted_chip_reading(MOVING, 3)[[0, 1, 5]]).max() < ROUNDING


def test_lifted_chip_takes_its_share() -> None:
    straight = np.array([0.03, -0.02, 0.0, 0.0, 0.0, 0.0])
    got = lifted_chip_reading(straight, 1)
    np.testing.assert_allclose(got[:2], straight[:2] * 2.0 / 3.0, atol=ROUNDING)
    assert abs(got[5]) > 0.1, "the missing chip looks like turning"
