"""Sensors: rate, latency, stamps, noise statistics, seeds and independent streams."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from slip_core.files.urdf_file import arm_urdf
from slip_core.params import build
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_sim_bridge.params import BridgeParams
from slip_sim_bridge.sensors.slip import dead_band
from slip_sim_bridge.sensors.suite import SensorSuite
from slip_sim_bridge.session import BridgeSession

MS = 1_000_000
SIGMAS = 5.0  # a fair sample of fixed seed lies well within


def suite(seed: int = 0, **values) -> SensorSuite:
    planar = {"contacts.slip_axes": (True, True, False, False, False, True), "seed": seed}
    return SensorSuite(
        build(BridgeParams, {f"sensors.{k.replace('__', '.')}": v for k, v in values.items()} | planar, "test")
    )


def slip_at(tick: int, period_ns: int = MS, start_ns: int = 0) -> SlipSample:
    return SlipSample(start_ns + tick * period_ns, np.array([0.01 * tick, 0, 0, 0, 0, 0]))


def run(sensors: SensorSuite, ticks: int, **timing):
    """Published slip samples with the stamp of the tick that published them."""
    out = []
    for k in range(ticks):
        truth = slip_at(k, **timing)
        out += [(truth.stamp_ns, sample) for sample in sensors.slip.update(truth)]
    return out


def test_ideal_sensors_hand_over_the_truth_itself():
    sensors = suite()
    slip, wrench = slip_at(3), WrenchSample(3 * MS, np.arange(6.0))
    joint = JointSample(3 * MS, np.zeros(7), np.ones(7), np.ones(7))
    assert sensors.slip.update(slip) == (slip,)
    assert sensors.wrench.update(wrench) == (wrench,)
    assert sensors.joint.update(joint) is joint


@pytest.mark.parametrize("rate", [25.0, 60.0, 120.0, 333.0, 500.0, 1000.0])
def test_rate_gives_that_many_samples_without_drift(rate):
    published = run(suite(slip__rate_hz=rate), 10_000, start_ns=123 * MS)
    assert len(published) == 10 * rate
    stamps = np.array([sample.stamp_ns for _, sample in published]) - 123 * MS
    ideal = np.arange(len(stamps)) * 1e9 / rate
    assert stamps[0] == 0
    assert (stamps >= ideal - 1).all()
    assert (stamps < ideal + MS).all()  # at the first tick not before


def test_a_sensor_faster_than_the_ticks_measures_every_tick():
    assert len(run(suite(slip__rate_hz=5000.0), 50)) == 50


@pytest.mark.parametrize(("latency_s", "late_ticks"), [(0.0, 0), (0.002, 2), (0.0025, 3), (0.033, 33)])
def test_latency_delays_publication_and_keeps_stamp_and_value(latency_s, late_ticks):
    published = run(suite(slip__latency_s=latency_s), 200)
    assert len(published) == 200 - late_ticks
    for now_ns, sample in published:
        assert now_ns - sample.stamp_ns == late_ticks * MS
        assert sample.twist[0] == 0.01 * (sample.stamp_ns // MS)


def test_rate_and_latency_together():
    published = run(suite(slip__rate_hz=120.0, slip__latency_s=0.010), 1000)
    assert all(now - sample.stamp_ns == 10 * MS for now, sample in published)
    assert len(published) == 119  # 120 measurements, the last one still under way


def test_a_dead_band_takes_each_half_for_itself_and_whole() -> None:
    twist, limits = np.array([0.3, -0.4, 0.0, 0.5, 0.3, -0.4]), (0.5, math.hypot(0.5, 0.5))
    for kept in itertools.product((0, 1), repeat=2):
        linear, angular = (norm * (0.99 if keeps else 1.01) for norm, keeps in zip(limits, kept, strict=True))
        np.testing.assert_array_equal(dead_band(twist, linear, angular), twist * np.repeat(kept, 3))


def test_several_samples_due_at_once_come_oldest_first():
    sensors = suite(slip__latency_s=0.003)
    assert sensors.slip.update(slip_at(0)) == ()
    assert sensors.slip.update(slip_at(1)) == ()
    stamps = [sample.stamp_ns for sample in sensors.slip.update(slip_at(10))]
    assert stamps == [0, MS]


@pytest.mark.parametrize("seed", [0, 7])
def test_noise_has_the_configured_deviation_and_is_white(seed):
    sensors = suite(
        seed,
        slip__noise_linear=1e-3,
        slip__noise_angular=2e-2,
        wrench__noise_force=0.1,
        wrench__noise_torque=0.01,
        joint__noise_position=1e-4,
        joint__noise_velocity=1e-2,
    )
    count = 4000
    slips, wrenches, joints = [], [], []
    for k in range(count):
        slips += [s.twist for s in sensors.slip.update(SlipSample(k * MS, np.zeros(6)))]
        wrenches += [s.wrench for s in sensors.wrench.update(WrenchSample(k * MS, np.zeros(6)))]
        joint = sensors.joint.update(JointSample(k * MS, np.zeros(7), np.zeros(7), np.zeros(7)))
        joints.append(np.concatenate((joint.position, joint.velocity)))
    check_noise(np.array(slips), [1e-3, 1e-3, 0, 0, 0, 2e-2])  # nothing on axes that cannot slip
    check_noise(np.array(wrenches), [0.1] * 3 + [0.01] * 3)
    check_noise(np.array(joints), [1e-4] * 7 + [1e-2] * 7)


def check_noise(samples, deviations):
    count = len(samples)
    for column, deviation in zip(samples.T, deviations, strict=True):
        if deviation == 0.0:
            assert not column.any()
            continue
        assert abs(column.mean()) < SIGMAS * deviation / np.sqrt(count)
        assert column.std() == pytest.approx(deviation, rel=SIGMAS / np.sqrt(2 * count))
        lagged = column[1:] @ column[:-1] / (count * deviation**2)
        assert abs(lagged) < SIGMAS / np.sqrt(count)


def noise_of(sensors: SensorSuite, ticks: int = 20):
    slips = [sensors.slip.update(SlipSample(k * MS, np.zeros(6)))[0].twist for k in range(ticks)]
    wrenches = [sensors.wrench.update(WrenchSample(k * MS, np.zeros(6)))[0].wrench for k in range(ticks)]
    return np.array(slips), np.array(wrenches)


def test_a_wrench_sensor_may_have_noise_in_force_or_in_torque_alone():
    for force, torque in ((0.1, 0.0), (0.0, 0.01)):
        _, wrenches = noise_of(suite(3, wrench__noise_force=force, wrench__noise_torque=torque), 500)
        check_noise(wrenches, [force] * 3 + [torque] * 3)


def test_seed_decides():
    noisy = {"slip__noise_linear": 0.1, "wrench__noise_force": 1.0}
    first = suite(5, **noisy)
    slips, wrenches = noise_of(first)
    again_slips, again_wrenches = noise_of(suite(5, **noisy))
    assert np.array_equal(slips, again_slips)
    assert np.array_equal(wrenches, again_wrenches)
    other_slips, _ = noise_of(suite(6, **noisy))
    assert not np.array_equal(slips, other_slips)


def test_streams_are_independent():
    both, _ = noise_of(suite(5, slip__noise_linear=0.1, wrench__noise_force=1.0))
    alone, _ = noise_of(suite(5, slip__noise_linear=0.1))
    assert np.array_equal(both, alone)
    slips, wrenches = noise_of(suite(5, slip__noise_linear=0.1, wrench__noise_force=1.0), 2000)
    assert abs(np.corrcoef(slips[:, 0], wrenches[:, 0])[0, 1]) < SIGMAS / np.sqrt(2000)


def test_a_reset_begins_the_noise_again_and_leaves_faults_switched():
    noisy = {"sensors.wrench.noise_force": 1.0, "sensors.slip.latency_s": 0.002}
    arm = build(BridgeParams, noisy, "test")
    session = BridgeSession({"": arm}, {"": arm_urdf(arm)})
    session.change([build(BridgeParams, noisy | {"sensors.wrench.bias": [9.0] * 6}, "test")])
    rounds = []
    for _ in range(2):
        ticks = [session.observe().arms[0] for _ in range(3)]
        rounds.append(ticks[0].wrenches[0].wrench)
        assert not ticks[1].slips, "what was under way is forgotten"
        session.request_reset()
    np.testing.assert_allclose(rounds[0], rounds[1], atol=1e-9)
    assert rounds[0].mean() > 5.0
