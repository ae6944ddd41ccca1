"""Angles of a run, as the report shows them."""

import numpy as np
import pytest

from slip_bringup.series import rotation_angle_about


def about_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def test_an_angle_goes_on_beyond_a_turn_and_starts_at_zero() -> None:
    angles = np.linspace(1.0, 9.0, 60)
    seen = rotation_angle_about(np.array([about_z(angle) for angle in angles]), np.array([0.0, 0.0, 1.0]))
    assert seen == pytest.approx(angles - 1.0, abs=1e-12)
