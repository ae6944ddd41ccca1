"""Every run predicted from the others: the test of the prediction.

Nested: what an ensemble adds for the model's error is chosen on runs that were left out once more, among those it was
fitted to, so that the run that is predicted has no part in it.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence

import numpy as np

from slip_core.errors import InputError
from tools.real_data.calibrate import Member, as_json, fit, from_json
from tools.real_data.predict import Draws, Ensemble, Prediction, best_deviation, draw, predict
from tools.real_data.table import DATA, Run, read_table

ENSEMBLES = DATA / "real_runs_cross.json"


def leave_one_out(members: int, processes: int, seed: int) -> None:
    """Fit an ensemble without each run, and write all of them."""
    runs = read_table()
    fits: dict[tuple[str, ...], list[Member]] = {}
    for size in (len(runs) - 2, len(runs) - 1):
        for some in itertools.combinations(runs, size):
            names = tuple(run.name for run in some)
            fits[names] = fit(some, members, 100 * seed + len(fits) + 1, processes)
    deviations = {run.name: _deviation([other for other in runs if other is not run], fits) for run in runs}
    texts = [json.dumps("all") + ":" + json.dumps(_deviation(runs, fits))]
    for run in runs:
        names = tuple(other.name for other in runs if other is not run)
        one = json.dumps(as_json(fits[names], deviations[run.name]), separators=(",", ":"))
        texts.append(f"{json.dumps(run.name)}:{one}")
    ENSEMBLES.write_text("{" + ",\n".join(texts) + "}\n")


def _deviation(runs: Sequence[Run], fits: dict[tuple[str, ...], list[Member]]) -> float:
    """Return the model's error that suits these runs best, each predicted from the others."""
    seen: list[tuple[Draws, float, float]] = []
    for run in runs:
        found = fits[tuple(other.name for other in runs if other is not run)]
        draws = draw(run.pads(), from_json(as_json(found, 0.0)))
        seen.append((draws, float(np.nanmax(run.rotation)), float(np.nanmin(run.rotation))))
    return best_deviation(seen)


def ensembles() -> tuple[dict[str, Ensemble], float]:
    """Return the ensemble without each run by its name, and the model's error for a new run.

    Raises:
        InputError: the ensembles have not been fitted.
    """
    if not ENSEMBLES.is_file():
        raise InputError(f"fits {ENSEMBLES}", got="no such file", expected="an ensemble per run", fix="cross --refit")
    data = json.loads(ENSEMBLES.read_text())
    return {name: from_json(one) for name, one in data.items() if name != "all"}, data["all"]


def predictions() -> list[tuple[Run, Prediction]]:
    """Return every run with what is predicted of it by the ensemble that never saw it."""
    found, _ = ensembles()
    return [(run, predict(run.pads(), found[run.name])) for run in read_table()]


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
