"""The numbers of the observer that follow from its parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi2

from slip_core.records import new, record
from slip_vic_controller.config.observer import observer_config
from slip_vic_controller.contact.observer import OBSERVER, OBSERVER_CONFIG, ROW, is_confirmed
from test.unit.contact.rig import given, make_params


def config_of(**values):
    return record(observer_config(*given(**values)), OBSERVER_CONFIG)


@pytest.mark.parametrize(
    "axes", [(True,) * 6, (True, True, False, False, False, True), (False, True, False, False, False, False)]
)
def test_thresholds_are_quantiles_of_chi_squared(axes: tuple[bool, ...]) -> None:
    config = config_of(contacts__slip_axes=axes)
    assert config.axes.tolist() == list(axes)
    np.testing.assert_allclose(config.nis_slip, chi2.isf(1e-8, sum(axes)), rtol=1e-9)
    np.testing.assert_allclose(config.nis_stick, chi2.ppf(0.8, sum(axes)), rtol=1e-9)


def test_axes_are_the_own_contacts() -> None:
    own, other = (True, False, False, False, False, True), (False, True, True, False, False, False)
    two = {
        "contacts__position": (0.0, 0.1, 0.0, 0.0, -0.1, 0.0),
        "contacts__orientation_xyzw": (0.0, 0.0, 0.0, 1.0) * 2,
    }
    config = config_of(contacts__slip_axes=own + other, **two)
    assert config.axes.tolist() == list(own)
    assert not observer_config(make_params()).flags.writeable


def test_variances_follow_from_noise_and_inertia() -> None:
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


def test_sensor_variances_have_a_floor() -> None:
    config = config_of(
        slip_sensor__noise_linear=0.0, slip_sensor__quantum_linear=0.0, slip_sensor__noise_angular=0.0,
        observer__least_slip=(3e-4, 7e-3),
    )  # fmt: skip
    for name in ("measurement_variance", "floor_variance"):
        np.testing.assert_allclose(config[name], [9e-8] * 3 + [49e-6] * 3, rtol=1e-12, err_msg=name)


def test_times_become_whole_ticks() -> None:
    config = config_of(observer__dwell_s=0.2, observer__window_s=0.06)
    assert (config.dwell_ticks, config.window_ticks) == (200, 60)
    assert config_of(observer__window_s=1e-4).window_ticks == 1


def test_errors_are_confirmed_jointly() -> None:
    """Of b and c apart little is known at a steady force; their sum b + c f may be known well."""
    config, state, row = config_of(), record(new(OBSERVER), OBSERVER), record(new(ROW), ROW)
    row.dt, row.force[:] = 1e-3, 2.0
    for i in range(6):
        state.axes[i].P_bb, state.axes[i].P_bc, state.axes[i].P_cc = 4e3, -2e3, 1e3  # 4000 - 8000 + 4000 = 0
    for variance in (0.0, 1e-9):
        row.velocity_variance[:] = variance
        assert is_confirmed(config, state, row)
    for P_bc in (2e3, -1e3):
        state.axes[0].P_bc = P_bc
        assert not is_confirmed(config, state, row)
