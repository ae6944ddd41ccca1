"""The rigid field of a tactile pad: exact where the field is rigid, hardly moved by outliers, honest about the rest."""

from __future__ import annotations

import numpy as np
import pytest

from examples.tactile_adapters.conversions import taxel_places
from examples.tactile_adapters.field_twist import planar_twist
from slip_core.errors import InputError

GRID = taxel_places(4, 4, 4.7e-3)[:, :2]
LINEAR, ANGULAR = np.array([0.3, -0.2]), 40.0


def rigid(points, linear=LINEAR, angular=ANGULAR, about=(0.0, 0.0)):
    arm = points - np.asarray(about)
    return linear + angular * np.stack([-arm[:, 1], arm[:, 0]], axis=1)


def test_exact_on_a_rigid_field():
    twist = planar_twist(GRID, rigid(GRID))
    np.testing.assert_allclose(twist.linear, LINEAR, atol=1e-12)
    assert twist.angular == pytest.approx(ANGULAR, rel=1e-12)
    assert twist.residual < 1e-12


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_outliers_hardly_turn_it(count):
    """A dead taxel and a stuck one at full scale: plain least squares is off by a multiple, this by little."""
    rng = np.random.default_rng(count)
    field = rigid(GRID) + 0.01 * rng.standard_normal(GRID.shape)
    wrong = rng.choice(len(GRID), count, replace=False)
    field[wrong] = rng.choice([-20.0, 20.0], (count, 2))
    twist = planar_twist(GRID, field)
    np.testing.assert_allclose(twist.linear, LINEAR, atol=0.05)
    assert twist.angular == pytest.approx(ANGULAR, abs=8.0)
    assert twist.weights[wrong].max() < 0.05
    design = np.zeros((2 * len(GRID), 3))
    design[0::2, 0] = design[1::2, 1] = 1.0
    design[0::2, 2], design[1::2, 2] = -GRID[:, 1], GRID[:, 0]
    plain = np.linalg.lstsq(design, field.ravel(), rcond=None)[0]
    assert abs(plain[2] - ANGULAR) > 10.0 * abs(twist.angular - ANGULAR)


def test_taxels_without_a_reading():
    field = rigid(GRID)
    field[3] = np.nan
    twist = planar_twist(GRID, field)
    assert twist.angular == pytest.approx(ANGULAR, rel=1e-9)
    assert twist.weights[3] == 0.0


@pytest.mark.parametrize(("points", "field"), [
    (GRID, np.zeros((15, 2))),
    (GRID[:1], np.zeros((1, 2))),
    (np.zeros((4, 2)), np.ones((4, 2))),
    (GRID, np.full((16, 2), np.nan)),
])  # fmt: skip
def test_refuses_what_has_no_answer(points, field):
    with pytest.raises(InputError, match="tactile field"):
        planar_twist(points, field)
