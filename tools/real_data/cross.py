"""Every run predicted from the others: what the prediction is worth, before anybody else's run is looked at."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tools.real_data.calibrate import Member, fit
from tools.real_data.predict import DISCREPANCY, Discrepancy, Prediction, predict
from tools.real_data.table import Run, read_table


def leave_one_out(members: int, processes: int) -> Iterator[str]:
    """Yield a line of a table per run, and what they say together."""
    runs = read_table()
    yield "| run left out | kept | predicted (P) | max deg | predicted, 80 % | min deg | predicted, 80 % | rms deg |"
    yield "|---|---|---|---|---|---|---|---|"
    for index, run in enumerate(runs):
        others = [other for other in runs if other is not run]
        yield row(run, judge(run, fit(others, members, seed=index + 1, processes=processes), DISCREPANCY))


def judge(run: Run, found: list[Member], discrepancy: Discrepancy) -> Prediction:
    """Predict one run of the table with an ensemble that was fitted without it."""
    return predict(run.pads(), [member.standard for member in found], discrepancy)


def rms_deg(run: Run, prediction: Prediction) -> float:
    """Return how far the predicted trace is from the marker where it was seen [deg]."""
    error = np.interp(run.time - run.time[0], prediction.time, prediction.rotation) - run.rotation
    return float(np.sqrt(np.nanmean(error**2)))


def row(run: Run, prediction: Prediction) -> str:
    """Return a line of the table."""
    p = prediction.json()
    cells = [
        run.name, _word(run.kept), f"{_word(p['kept'])} ({prediction.probability_kept:.2f})",
        f"{np.nanmax(run.rotation):.1f}", f"{p['max_deg']:.1f}, {_interval(p['max_deg_80'])}",
        f"{np.nanmin(run.rotation):.1f}", f"{p['min_deg']:.1f}, {_interval(p['min_deg_80'])}",
        f"{rms_deg(run, prediction):.2f}",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def _word(kept: bool) -> str:
    return "kept" if kept else "lost"


def _interval(ends: list[float]) -> str:
    return f"{ends[0]:.1f} to {ends[1]:.1f}"
