"""Predict a run from the motion of its pads: trace, extremes with intervals, and whether the object stays.

Each member of the ensemble is simulated with grasps drawn as the grasps of its runs differ. What the model is off by is
a random factor on its angles, and the marker's noise. Both spreads come from the runs of the fit alone:
- tilt and grip of a new grasp are drawn from Student's t, the predictive distribution of a normal spread whose variance
  has an inverse chi-square prior (Gelman et al., Bayesian Data Analysis, 3rd ed., section 2.6), around PRIOR_RUNS runs;
- the factor's deviation is the one of DEVIATIONS whose intervals score best (interval score: Gneiting, Raftery 2007) on
  runs that were left out of the fit (`tools/real_data/cross.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.errors import InputError
from tools.real_data.grasp import OUT_OF_SIGHT, lost_at, simulate, values
from tools.real_data.runs import PadMotion

DRAWS = 12
SEED = 20220221
COVERAGE = 0.8
PRIOR_RUNS = 4.0  # that the spreads of grasp.py count for
DEVIATIONS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5)  # of the logarithm of real over modelled angles
NOISE_DEG = 0.2  # of the marker


class Ensemble(NamedTuple):
    """What was fitted: m members, to so many runs."""

    standard: Array  # (m, len(NAMES)), parameters in deviations of their priors
    of_runs: Array  # (m, runs, 2), tilt and grip of each run's grasp, in deviations of their spread
    deviation: float  # of the logarithm of the marker's angles over the model's

    @property
    def freedom(self) -> float:
        """Degrees of freedom of a new grasp's distribution."""
        return PRIOR_RUNS + self.of_runs.shape[1]

    @property
    def widths(self) -> Array:
        """Scale of a new grasp's tilt and grip, in deviations; (m, 2)."""
        return np.asarray(np.sqrt((PRIOR_RUNS + (self.of_runs**2).sum(axis=1)) / self.freedom))


class Draws(NamedTuple):
    """Simulated runs, before what the model is off by; d of them."""

    time: Array  # (n,) [s], from the first stamp
    kept: Array  # (d,) bool
    rotation: Array  # (d, n) [deg]
    slid: Array  # (d,) [m], at the end
    factor: Array  # (d,) standard normal
    noise: Array  # (d, 2), of maximum and minimum; absolute standard normal


class Prediction(NamedTuple):
    """What will be seen; angles in degrees."""

    probability_kept: float
    time: Array  # (n,) [s]
    rotation: Array  # (n,)
    maxima: Array  # (draws,)
    minima: Array  # (draws,)
    slid: Array  # (draws,) [m], at the end

    @property
    def kept(self) -> bool:
        """Whether the object more likely stays than not."""
        return self.probability_kept > 0.5

    def json(self) -> dict[str, Any]:
        """Return the prediction as plain numbers."""
        ends = 50.0 * np.array([1.0 - COVERAGE, 1.0 + COVERAGE])
        result: dict[str, Any] = {
            "kept": self.kept,
            "probability_kept": round(self.probability_kept, 3),
            "rotation_deg": {"t": self.time.round(4).tolist(), "deg": self.rotation.round(3).tolist()},
        }
        for name, draws in (("max_deg", self.maxima), ("min_deg", self.minima)):
            result[name] = round(float(np.median(draws)), 2)
            result[f"{name}_80"] = np.percentile(draws, ends).round(2).tolist()
        return result


def draw(pads: PadMotion, ensemble: Ensemble, seed: int = SEED) -> Draws:
    """Simulate a run with every member, several grasps each.

    An object that is lost turns no further once a camera on the hand would have lost it from sight.

    Raises:
        InputError: a motion beyond all that the model can compute.
    """
    rng = np.random.default_rng(seed)
    kept, rotations, slid = [], [], []
    for standard, width in zip(ensemble.standard, ensemble.widths, strict=True):
        p = values(standard)
        for _ in range(DRAWS):
            motion = simulate(p, pads, width * rng.standard_t(ensemble.freedom, 2))
            if not np.isfinite(np.array(motion)).all():
                raise InputError("run", got="a motion that cannot be simulated", expected="that of an arm")
            rotation = np.rad2deg(motion.rotation)
            gone = np.flatnonzero(motion.slid > OUT_OF_SIGHT)
            if gone.size:
                rotation[gone[0] :] = rotation[max(gone[0] - 1, 0)]
            kept.append(lost_at(motion, p) is None)
            rotations.append(rotation)
            slid.append(motion.slid[-1])
    count = len(kept)
    factor, noise = rng.standard_normal(count), np.abs(rng.standard_normal((count, 2)))
    return Draws(pads.time - pads.time[0], np.array(kept), np.array(rotations), np.array(slid), factor, noise)


def summarise(draws: Draws, deviation: float) -> Prediction:
    """Predict from draws; `deviation` is that of the factor's logarithm.

    The trace is the median of the draws that end as most do; the extremes are of all draws.
    """
    rotation = np.exp(deviation * draws.factor)[:, None] * draws.rotation
    share = float(draws.kept.mean())
    typical = np.median(rotation[draws.kept == (share > 0.5)], axis=0)
    maxima = rotation.max(axis=1) + NOISE_DEG * draws.noise[:, 0]
    minima = rotation.min(axis=1) - NOISE_DEG * draws.noise[:, 1]
    return Prediction(share, draws.time, typical, maxima, minima, draws.slid)


def predict(pads: PadMotion, ensemble: Ensemble, seed: int = SEED) -> Prediction:
    """Predict one run; stamps of the trace count from the run's first."""
    return summarise(draw(pads, ensemble, seed), ensemble.deviation)


def interval_score(prediction: Prediction, largest: float, smallest: float) -> float:
    """Return the interval score of both extremes, over their size; smaller is better [deg]."""
    p = prediction.json()
    score = 0.0
    for seen, (low, high) in ((largest, p["max_deg_80"]), (smallest, p["min_deg_80"])):
        outside = max(low - seen, seen - high, 0.0)
        score += (high - low + 2.0 / (1.0 - COVERAGE) * outside) / max(abs(seen), 1.0)
    return score


def best_deviation(seen: Sequence[tuple[Draws, float, float]]) -> float:
    """Return the deviation with the best intervals, from runs that were left out: draws, largest and smallest angle."""

    def total(deviation: float) -> float:
        return sum(interval_score(summarise(draws, deviation), high, low) for draws, high, low in seen)

    return min(DEVIATIONS, key=total)
