"""Detectors on recorded runs: the scoring on made-up intervals, and what the page claims of the committed table."""

from __future__ import annotations

import numpy as np
import pytest

from tools.real_data.detect import (
    even,
    intervals,
    observed,
    over,
    rest_noise,
    score,
    shear_load,
    slopes,
    true_slips,
    twist_rate,
)
from tools.real_data.table import read_table

RUNS = read_table()


def test_score_counts_where_detections_begin():
    true = [(1.0, 1.2), (2.0, 2.5), (3.0, 3.1)]
    one = score([(1.1, 1.3), (2.1, 2.2), (4.0, 4.1)], true)
    assert (one.found, one.missed, one.false) == (2, 1, 1)
    assert one.delays == pytest.approx((0.1, 0.1))


def test_a_detector_that_is_always_on_finds_nothing():
    one = score([(0.0, 5.0)], [(1.0, 1.2), (2.0, 2.5)])
    assert (one.found, one.missed, one.false) == (0, 2, 1)


def test_a_detection_that_goes_on_finds_the_next_slip_too():
    one = score([(1.05, 2.3)], [(1.0, 1.2), (2.0, 2.5)])
    assert (one.found, one.missed, one.false) == (2, 0, 0)
    assert one.delays == pytest.approx((0.05, 0.0))


def test_intervals_close_gaps_and_drop_short_ones():
    t = np.arange(10.0)
    on = np.array([0, 1, 1, 0, 1, 1, 0, 0, 1, 0], dtype=bool)
    assert intervals(t, on) == [(1.0, 2.0), (4.0, 5.0), (8.0, 8.0)]
    assert intervals(t, on, merged=2.0) == [(1.0, 5.0), (8.0, 8.0)]
    assert intervals(t, on, shortest=1.0) == [(1.0, 2.0), (4.0, 5.0)]


def test_slopes_look_back_only():
    ramp = np.concatenate([np.zeros(20), np.arange(20) / 60.0 * 3.0])
    assert slopes(ramp, 4)[-1] == pytest.approx(3.0)
    assert not slopes(ramp, 4)[:20].any()


def test_true_slips_grow_with_the_acceleration():
    assert [len(true_slips(run)) for run in RUNS] == [0, 1, 4, 2]


def test_the_observer_finds_every_slip_within_a_tenth_of_a_second():
    """Of the marker at its rate, with the noise of the other runs; false ones where the marker is noisiest."""
    for run in RUNS:
        found = observed(run, rest_noise([other for other in RUNS if other is not run]))
        one = score(found, true_slips(run))
        assert one.missed == 0, run.name
        assert all(delay < 0.1 for delay in one.delays), run.name
        assert one.false == (3 if run is RUNS[0] else 0), run.name


def test_signals_are_of_the_seen_part():
    for run in RUNS:
        t, _ = even(run)
        assert twist_rate(run).shape == shear_load(run).shape == t.shape
        assert over(run, shear_load(run), np.inf) == []
