"""The numbers of the observer that follow from its parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from slip_core.records import new, record
from slip_vic_controller.arm.config import velocity_correlation
from slip_vic_controller.contact.config import observer_config
from slip_vic_controller.contact.layouts import OBSERVER, OBSERVER_CONFIG, ROW
from slip_vic_controller.contact.slip import is_confirmed
from slip_vic_controller.contact.stick import SLOW_GROWTH, window_ticks
from test.unit.contact.rig import make_params


def config_of(**values):
    params = make_params(**values)
    return record(observer_config(params, correlation_ticks=velocity_correlation(params)), OBSERVER_CONFIG)


def test_thresholds_are_quantiles_of_chi_squared() -> None:
    for axes in ((True,) * 6, (True, True, False, False, False, True), (False, True, False, False, False, False)):
        config = config_of(contacts__slip_axes=axes)
        assert config.axes.tolist() == list(axes)
        np.testing.assert_allclose(config.nis_slip, chi2.isf(1e-8, sum(axes)), rtol=1e-9)
        np.testing.assert_allclose(config.nis_stick, chi2.ppf(0.8, sum(axes)), rtol=1e-9)


def test_the_axes_are_those_of_the_own_contact() -> None:
    own, other = (True, False, False, False, False, True), (False, True, True, False, False, False)
    two = {
        "contacts__position": (0.0, 0.1, 0.0, 0.0, -0.1, 0.0),
        "contacts__orientation_xyzw": (0.0, 0.0, 0.0, 1.0) * 2,
    }
    assert config_of(contacts__slip_axes=own + other, **two).axes.tolist() == list(own)


def test_it_is_read_only() -> None:
    assert not observer_config(make_params(), correlation_ticks=0.0).flags.writeable


def test_variances_follow_from_noise_mass_and_inertia() -> None:
    """0.1 N and 1e-3 N m on 0.5 kg and 2e-3 kg m2, 20 mm from the centre of mass; 1 ms."""
    config = config_of(
        wrench_sensor__noise_force=0.1, wrench_sensor__noise_torque=1e-3, wrench_sensor__bias_force=0.2,
        wrench_sensor__bias_torque=0.0001, slip_sensor__noise_linear=3e-3, slip_sensor__quantum_linear=4e-3,
        slip_sensor__dead_band_angular=0.1, object__mass=0.5, object__inertia=(2e-3, 2e-3, 2e-3, 0.0, 0.0, 0.0),
        contacts__position=(0.02, 0.0, 0.0),
    )  # fmt: skip
    turning = math.hypot(1e-3, 0.02 * 0.1) / 2e-3
    moving = math.hypot(0.1 / 0.5, 0.02 * turning)
    bias = math.hypot(0.0001, 0.02 * 0.2) / 2e-3
    expected = {
        "measurement_variance": (5e-3**2, 2e-3**2),  # the angular floor
        "process_variance": (1e-6 * (moving**2 + 0.003**2), 1e-6 * (turning**2 + 0.03**2)),
        "drift_variance": (1e-3 * 0.003**2, 1e-3 * 0.15**2),
        "prior_P_bb": (0.4**2, bias**2),
        "prior_P_cc": (0.04, 0.04),
        "onset_gain": (0.02**2 * 0.2 * 0.5 / 2e-3, 0.02 * 0.2 * 0.5 / 2e-3),
        "dead_band": (0.0, 0.1),
    }
    for name, (linear, angular) in expected.items():
        np.testing.assert_allclose(config[name], [linear] * 3 + [angular] * 3, rtol=1e-12, err_msg=name)


def test_no_sensor_is_believed_to_be_better_than_its_floor() -> None:
    config = config_of(
        slip_sensor__noise_linear=0.0, slip_sensor__quantum_linear=0.0, slip_sensor__noise_angular=0.0,
        observer__min_slip_std_m_s=3e-4, observer__min_slip_std_rad_s=7e-3,
    )  # fmt: skip
    for name in ("measurement_variance", "floor_variance"):
        np.testing.assert_allclose(config[name], [9e-8] * 3 + [49e-6] * 3, rtol=1e-12, err_msg=name)


REAL_ARM = {"tare__duration_s": 0.3}


def test_a_weighed_object_leaves_little_of_a_mass_error() -> None:
    params = make_params(**REAL_ARM)
    before, after = (
        record(observer_config(params, weighed=weighed), OBSERVER_CONFIG).prior_P_cc for weighed in (False, True)
    )
    expected = params.observer.model_error**2
    np.testing.assert_allclose(before, expected)
    assert np.all(after[:3] < 0.5 * expected)
    assert np.all(after[:3] >= (params.tare.force / (params.object.mass * 9.81)) ** 2 * 0.99)
    np.testing.assert_allclose(after[3:], expected)


def test_below_a_governor_and_without_weight_nothing_is_known_of_the_mass() -> None:
    for more in ({"governor__mode": "slow_down"}, {"gravity": (0.0, 0.0, 0.0)}):
        config = record(observer_config(make_params(**REAL_ARM, **more), weighed=True), OBSERVER_CONFIG)
        np.testing.assert_allclose(config.prior_P_cc, 0.2**2)


def test_what_happened_since_a_late_sample_is_kept_without_a_governor() -> None:
    late = {"slip_sensor__latency_s": 0.08}
    assert config_of(**REAL_ARM, **late).window_ticks == 80
    assert config_of(**REAL_ARM, observer__memory_s=0.06, **late).window_ticks == 60, "older ones are not used"
    assert config_of(**REAL_ARM).window_ticks == config_of(**late).window_ticks == 40


def test_slip_must_show_over_the_longer_the_noisier_the_velocities_are_where_they_are_estimated() -> None:
    config, row = config_of(**REAL_ARM), record(new(ROW), ROW)
    row.dt = 1e-3
    assert config.longest_window_ticks > 3 * config.window_ticks
    for share in (0.5, 2.0, 3.0):
        wanted = share * config.window_ticks
        row.velocity_variance[0] = (SLOW_GROWTH * 1e-3 * wanted) ** 2 / (2.0 * config.nis_slip)
        assert window_ticks(config, row) == pytest.approx(max(wanted, config.window_ticks), abs=1.0)
    row.velocity_variance[0] = 1.0
    assert window_ticks(config, row) == config.longest_window_ticks
    row.dt = 0.0
    assert window_ticks(config, row) == config.window_ticks
    row.dt, exact = 1e-3, config_of()
    assert window_ticks(exact, row) == exact.window_ticks == exact.longest_window_ticks


def test_noise_of_estimated_velocities_lasts_unless_it_is_the_lag_of_a_filter_and_samples_are_soon_there() -> None:
    filtered = {"joint_sensor__quantum_position": 5e-5, "joint_sensor__velocity_filter_hz": 50.0}
    assert config_of(**REAL_ARM, joint_sensor__noise_velocity=1e-3).correlation_ticks > 1.0
    camera = {"slip_sensor__rate_hz": 100.0}  # the next sample comes 10 ms after the last one
    assert config_of(**REAL_ARM, **filtered, **camera, slip_sensor__latency_s=0.029).correlation_ticks == 0.0
    assert config_of(**REAL_ARM, **filtered, **camera, slip_sensor__latency_s=0.031).correlation_ticks > 1.0
    assert config_of().correlation_ticks == 0.0


def test_slip_is_over_once_a_sample_of_that_time_has_come_where_no_governor_slows_the_path() -> None:
    camera = {"slip_sensor__latency_s": 0.08}
    assert config_of(**REAL_ARM, **camera).dwell_ticks == 80
    assert config_of(**REAL_ARM, **camera, observer__dwell_s=0.2).dwell_ticks == 200
    for config in (
        config_of(**camera),
        config_of(**REAL_ARM),
        config_of(**REAL_ARM, **camera, governor__mode="slow_down"),
    ):
        assert config.dwell_ticks == 5


def test_slip_that_is_likely_needs_less_evidence_where_the_arm_is_a_real_one() -> None:
    alone = config_of(**REAL_ARM)
    np.testing.assert_allclose(alone.nis_likely, chi2.isf(1e-4, 3), rtol=1e-9)
    assert config_of(**REAL_ARM, observer__false_alarm_rate=0.01).nis_likely == pytest.approx(chi2.isf(0.1, 3))
    governed = {"governor__mode": "slow_down"}
    assert config_of(**REAL_ARM, **governed).nis_likely == alone.nis_likely
    for config in (config_of(), config_of(**governed)):
        assert config.nis_likely == config.nis_slip == alone.nis_slip


def test_where_velocities_are_noisy_bias_and_gain_count_together_as_they_act() -> None:
    """Of b and c apart little is known at a steady force; their sum b + c f may be known well."""
    config, state, row = config_of(**REAL_ARM), record(new(OBSERVER), OBSERVER), record(new(ROW), ROW)
    row.dt, row.force[:] = 1e-3, 2.0
    for i in range(6):
        state.axes[i].P_bb, state.axes[i].P_bc, state.axes[i].P_cc = 4e3, -2e3, 1e3  # 4000 - 8000 + 4000 = 0
    assert not is_confirmed(config, state, row), "exact velocities tell b alone"
    row.velocity_variance[:] = 1e-9
    assert is_confirmed(config, state, row)
    for P_bc in (2e3, -1e3):
        state.axes[0].P_bc = P_bc
        assert not is_confirmed(config, state, row)
