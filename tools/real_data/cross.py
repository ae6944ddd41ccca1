"""Every run predicted from the others: what the prediction is worth, before anybody else's run is looked at."""

from __future__ import annotations

import json

import numpy as np

from slip_core.errors import InputError
from tools.real_data.calibrate import fit
from tools.real_data.predict import DISCREPANCY, Discrepancy, Prediction, predict
from tools.real_data.table import DATA, Run, read_table

ENSEMBLES = DATA / "real_runs_cross.json"


def leave_one_out(members: int, processes: int) -> None:
    """Fit an ensemble without each run, and write all of them."""
    runs = read_table()
    found = {}
    for index, run in enumerate(runs):
        others = [other for other in runs if other is not run]
        ensemble = fit(others, members, seed=index + 1, processes=processes)
        found[run.name] = [np.round(member.standard, 4).tolist() for member in ensemble]
    lines = ",\n".join(f"{json.dumps(name)}:{json.dumps(one, separators=(',', ':'))}" for name, one in found.items())
    ENSEMBLES.write_text(f"{{{lines}}}\n")


def predictions(discrepancy: Discrepancy = DISCREPANCY) -> list[tuple[Run, Prediction]]:
    """Return every run with what is predicted of it by the ensemble that never saw it.

    Raises:
        InputError: the ensembles have not been fitted.
    """
    if not ENSEMBLES.is_file():
        raise InputError(f"fits {ENSEMBLES}", got="no such file", expected="an ensemble per run", fix="cross --refit")
    ensembles = json.loads(ENSEMBLES.read_text())
    return [(run, predict(run.pads(), np.array(ensembles[run.name]), discrepancy)) for run in read_table()]


def table() -> list[str]:
    """Return the lines of the table."""
    return [
        "| run left out | kept | predicted (P) | max deg | predicted, 80 % | min deg | predicted, 80 % | rms deg |",
        "|---|---|---|---|---|---|---|---|",
        *(row(run, prediction) for run, prediction in predictions()),
    ]


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
