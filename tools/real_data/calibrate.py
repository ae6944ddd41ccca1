"""Fit the soft grasp to runs: an ensemble of parameters whose spread is what the runs and the priors leave open.

The best of several fits from starts drawn at random is the middle. Around it draws of the Gauss-Newton covariance are
weighted by what they really cost, tempered until EFFECTIVE of them count (importance resampling: Rubin 1988), since the
cost is rough on a small scale, where pads break away or not.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from multiprocessing import Pool
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from slip_core.arrays import Array
from tools.real_data.grasp import NAMES, simulate, values
from tools.real_data.predict import Ensemble
from tools.real_data.table import DATA, Run

CALIBRATION = DATA / "real_runs_grasp.json"
OF_RUN = 2
SKIPPED_S = 0.9  # before it nothing moves
WEIGHT = 0.35  # of a sample: neighbours err alike, one in eight says something new
FLOOR_DEG, FLOOR_DOWN = 0.3, 0.4  # deg, mm: noise of the marker
SHARE_DEG, SHARE_MM = 0.06, 0.1  # of the value: what a model of rigid parts may be off
DOUBT = 0.05  # errors count with e / sqrt(1 + DOUBT e^2)
CANDIDATES, EVALUATIONS = 60, 60
STARTS = 12
STEP = 0.05  # deviations, of finite differences: breakaway makes errors rough on a smaller scale
PROPOSALS = 400
EFFECTIVE = 60


class Member(NamedTuple):
    """One fit: parameters in deviations of their priors, grasps of the runs (runs, 2), and what it costs."""

    standard: Array
    of_runs: Array
    cost: float


def errors(x: Array, runs: Sequence[Run]) -> Array:
    """Return what least squares makes small: the distance from the priors and from the marker."""
    p, of_runs = values(x[: len(NAMES)]), x[len(NAMES) :].reshape(-1, OF_RUN)
    parts = [x]
    for run, of_run in zip(runs, of_runs, strict=True):
        motion = simulate(p, run.pads(), of_run)
        use = run.seen & (run.time > SKIPPED_S)
        for seen, modelled, floor, share in (
            (run.rotation, np.rad2deg(motion.rotation), FLOOR_DEG, SHARE_DEG),
            (run.down, 1e3 * motion.down, FLOOR_DOWN, SHARE_MM),
        ):
            e = (modelled[use] - seen[use]) / (floor + share * np.abs(seen[use]))
            parts.append(WEIGHT * e / np.sqrt(1.0 + DOUBT * e * e))
    everything = np.concatenate(parts)
    return np.where(np.isfinite(everything), everything, 10.0)


def cost(x: Array, runs: Sequence[Run]) -> float:
    """Return the sum of squares."""
    return float((errors(x, runs) ** 2).sum())


def slope(x: Array, runs: Sequence[Run]) -> Array:
    """Return the Jacobian of `errors` by central differences; (errors, x.size)."""
    steps = STEP * np.eye(x.size)
    return np.stack([(errors(x + e, runs) - errors(x - e, runs)) / (2.0 * STEP) for e in steps], axis=1)


def search(task: tuple[Sequence[Run], int]) -> Array:
    """Fit from the best of some random starts; `task` is the runs and the seed."""
    runs, seed = task
    starts = np.random.default_rng(seed).standard_normal((CANDIDATES, len(NAMES) + OF_RUN * len(runs)))
    start = min(starts, key=lambda x: cost(x, runs))
    found = least_squares(errors, start, slope, args=(runs,), max_nfev=EVALUATIONS, ftol=1e-3, xtol=1e-3)
    return np.asarray(found.x)


def spread(best: Array, runs: Sequence[Run], members: int, seed: int) -> list[Member]:
    """Return the best solution and members drawn around it."""
    rng = np.random.default_rng(seed)
    J = slope(best, runs)
    root = np.linalg.cholesky(np.linalg.inv(J.T @ J))
    normal = rng.standard_normal((PROPOSALS, best.size))
    draws = best + normal @ root.T
    costs = np.array([cost(x, runs) for x in draws])
    log_ratio = -0.5 * (costs - cost(best, runs)) + 0.5 * (normal**2).sum(axis=1)
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _effective(middle * log_ratio) > EFFECTIVE else (low, middle)
    weights = np.exp(low * (log_ratio - log_ratio.max()))
    chosen = rng.choice(PROPOSALS, members - 1, replace=False, p=weights / weights.sum())
    return [_member(x, runs) for x in (best, *draws[chosen])]


def fit(runs: Sequence[Run], members: int, seed: int, processes: int = 1) -> list[Member]:
    """Return an ensemble, the best solution first."""
    tasks = [(runs, seed * 1000 + i) for i in range(STARTS)]
    if processes == 1:
        found = [search(task) for task in tasks]
    else:
        with Pool(processes) as pool:
            found = pool.map(search, tasks, chunksize=1)
    return spread(min(found, key=lambda x: cost(x, runs)), runs, members, seed)


def _effective(log_weights: Array) -> float:
    weights = np.exp(log_weights - log_weights.max())
    return float(weights.sum() ** 2 / (weights**2).sum())


def _member(x: Array, runs: Sequence[Run]) -> Member:
    return Member(x[: len(NAMES)], x[len(NAMES) :].reshape(-1, OF_RUN), cost(x, runs))


def as_json(found: Sequence[Member], deviation: float) -> dict[str, Any]:
    """Return an ensemble as plain numbers, the parameters in deviations of their priors."""
    return {
        "deviation": deviation,
        "costs": [round(member.cost, 1) for member in found],
        "of_runs": [np.round(member.of_runs, 3).tolist() for member in found],
        "members": [np.round(member.standard, 4).tolist() for member in found],
    }


def from_json(data: dict[str, Any]) -> Ensemble:
    """Return the ensemble."""
    return Ensemble(np.array(data["members"], float), np.array(data["of_runs"], float), data["deviation"])


def write(path: Path, runs: Sequence[Run], found: Sequence[Member], deviation: float) -> None:
    """Write the ensemble of these runs."""
    names = {"source": "python tools/real_runs.py fit", "runs": [run.name for run in runs], "names": list(NAMES)}
    text = json.dumps({**names, **as_json(found, deviation)}, indent=None, separators=(",", ":"))
    path.write_text(text.replace('],"', '],\n"') + "\n")


def read(path: Path = CALIBRATION) -> tuple[Ensemble, dict[str, Any]]:
    """Return an ensemble, and all that its file has."""
    data = json.loads(path.read_text())
    return from_json(data), data
