"""Speed along the path: the chain rule, a bounded rate, and a clock that full speed leaves alone."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.params import build
from slip_core.records import dtype_of, new, record
from slip_vic_controller.params.controller_params import TrajectoryParams
from slip_vic_controller.path import paths
from slip_vic_controller.path.paths import PATH as PATH_LAYOUT
from slip_vic_controller.path.paths import REFERENCE, PathScaling, make_path, put_reference, reference_at
from test.support.call import call
from test.support.law_cases import reference_of

PATH_SCALING = dtype_of(PathScaling)

MS = 1_000_000
START = (np.array([0.5, -0.2, 0.3]), np.eye(3))
PATH = make_path(
    build(TrajectoryParams, {"kind": "quintic", "displacement": (0.4, 0.3, -0.1), "rotation": (0.2, -0.5, 0.8)}, "test")
)


def scaling(scale: float, rate: float = 0.0) -> np.ndarray:
    buffer = new(PATH_SCALING)
    record(buffer, PATH_SCALING).scale, record(buffer, PATH_SCALING).rate = scale, rate
    return buffer


def run_scaling(buffer: np.ndarray, wanted: float, dt_ns: int, slow_down_s: float) -> int:
    """Return the time that the path loses in a cycle [ns]."""
    state = record(buffer, PATH_SCALING)
    call(paths.advance, state, wanted, 1e-9 * dt_ns, slow_down_s)
    return call(paths.lost_ns, state, dt_ns)


def scaled(t: float, buffer: np.ndarray):
    out = record(new(REFERENCE), REFERENCE)
    planned = call(reference_at, record(PATH, PATH_LAYOUT), t, *START)
    call(put_reference, out, call(paths.scaled, planned, record(buffer, PATH_SCALING)))
    return out


def test_scaled_rates_are_derivatives() -> None:
    """s(t) = s_0 + sigma_0 t + rate t^2 / 2 along the path: differences of the pose give twist and acceleration."""
    s_0, sigma, rate, h = 0.9, 0.6, -0.5, 1e-4
    now = scaled(s_0, scaling(sigma, rate))
    x = [scaled(s_0 + sigma * t + 0.5 * rate * t * t, scaling(1.0)).position for t in (-h, 0.0, h)]
    np.testing.assert_allclose(now.twist[:3], (x[2] - x[0]) / (2 * h), atol=1e-7)
    np.testing.assert_allclose(now.acceleration[:3], (x[2] - 2 * x[1] + x[0]) / h**2, atol=1e-6)
    at = [scaled(s_0 + sigma * t + 0.5 * rate * t * t, scaling(sigma + rate * t)).twist[3:] for t in (-h, h)]
    np.testing.assert_allclose(now.acceleration[3:], (at[1] - at[0]) / (2 * h), atol=1e-6)


def test_full_speed_changes_no_bit() -> None:
    for t in np.linspace(0.0, 2.0, 20):
        assert scaled(t, scaling(1.0)).tobytes() == reference_of(PATH, t, *START).tobytes()


def test_scale_changes_at_bounded_rate() -> None:
    state, lost = scaling(1.0), 0
    for k in range(600):
        before = record(state, PATH_SCALING).scale
        lost += run_scaling(state, 0.0, MS, 0.5)
        after = record(state, PATH_SCALING)
        assert 0.0 <= before - after.scale <= 2e-3 + 1e-12
        assert after.rate == pytest.approx((after.scale - before) / 1e-3, abs=1e-9)
        assert (after.scale == 0.0) == (k >= 499)
    assert lost == pytest.approx(250 * MS + 100 * MS, abs=0.6 * MS)
    run_scaling(state, 0.0, 0, 0.5)
    assert record(state, PATH_SCALING).rate == 0.0


def test_reference_waits_for_arm() -> None:
    assert call(paths.scale_for_error, 0.15, 0.0, 0.3, 6.0) == 1.0
    assert call(paths.scale_for_error, 0.0, 4.5, 0.3, 6.0) == pytest.approx(0.5)
    assert call(paths.scale_for_error, 0.3, 0.0, 0.3, 6.0) == 0.0
    assert call(paths.scale_for_error, 9.0, 9.0, 0.3, 6.0) == 0.0
