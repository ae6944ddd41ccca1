"""The compiled drive and the parts of the slip sensor against their plain forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_sim_bridge.sim.drive_kernel import CLIPPED, NOT_FINITE, OBEYED, drive
from slip_sim_bridge.sim.sensor_kernel import draw_chances, exceeds
from slip_sim_bridge.simulation import driven_effort


@pytest.mark.parametrize("largest_change", [0.0, 0.5, math.inf])
def test_the_compiled_drive_is_the_plain_one(largest_change):
    rng, seen = np.random.default_rng(1), set()
    for spread in np.repeat([0.3, 3.0], 200):
        limit = np.array([1.0, 2.0, math.inf])
        last, wanted = rng.uniform(-1.0, 1.0, 3), spread * rng.standard_normal(3)
        applied = np.full(3, math.nan)
        outcome = drive(wanted, last, largest_change, limit, applied)
        expected, clipped = driven_effort(wanted, last, largest_change, limit)
        assert np.array_equal(applied, expected)
        assert outcome == (CLIPPED if clipped else OBEYED)
        seen.add(outcome)
    assert seen == ({OBEYED, CLIPPED} if largest_change > 0.0 else {OBEYED})


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("joint", [0, 2])
def test_the_drive_says_where_an_effort_is_not_finite(bad, joint):
    wanted = np.zeros(3)
    wanted[joint] = bad
    assert drive(wanted, np.zeros(3), math.inf, np.ones(3), np.zeros(3)) == NOT_FINITE


def test_chances_drawn_ahead_are_those_of_one_draw_after_the_other():
    ahead, one_by_one = np.random.default_rng(7), np.random.default_rng(7)
    block = np.empty((5000, 8))
    draw_chances(ahead, block)
    for row in block:
        assert np.array_equal(row, (*one_by_one.random(2), *one_by_one.standard_normal(6)))
    assert ahead.random() == one_by_one.random()


@pytest.mark.parametrize(
    ("values", "beyond"),
    [((1.0, -2.0), False), ((1.1, 0.0), True), ((0.0, -2.1), True), ((math.nan, 0.0), False), ((math.inf, 0.0), True)],
)
def test_exceeds_compares_sizes(values, beyond):
    values, bounds = np.array(values), np.array([1.0, 2.0])
    assert exceeds(values, bounds) is beyond
    with np.errstate(invalid="ignore"):
        assert bool((np.abs(values) > bounds).any()) is beyond
