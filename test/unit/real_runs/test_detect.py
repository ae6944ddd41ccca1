"""Detectors on recorded runs: the scoring on made-up intervals, and what the page claims of the committed table."""

from __future__ import annotations

from tools.real_data.detect import observed, rest_noise, score, true_slips
from tools.real_data.table import read_table

RUNS = read_table()


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
