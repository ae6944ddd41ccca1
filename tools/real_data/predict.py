"""Predict a run from the motion of its pads: trace, extremes with intervals, and whether the object stays.

Each member of the ensemble is simulated with grasps drawn as the grasps of the runs differ. What the model is off by is
a random factor on its angles, whose spread comes from leaving runs out (docs/real_runs.md), and the marker's noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from slip_core.arrays import Array
from tools.real_data.grasp import OUT_OF_SIGHT, lost_at, simulate, values
from tools.real_data.runs import PadMotion

DRAWS = 12
SEED = 20220221
COVERAGE = 0.8


class Discrepancy(NamedTuple):
    """Angles of the marker over angles of the model, log-normal, and the marker's own noise."""

    log_mean: float
    log_deviation: float
    noise_deg: float


DISCREPANCY = Discrepancy(log_mean=0.0, log_deviation=0.1, noise_deg=0.2)
"""What the predictions of runs from the others were off by; see docs/real_runs.md."""


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


def predict(pads: PadMotion, members: Sequence[Array], discrepancy: Discrepancy, seed: int = SEED) -> Prediction:
    """Predict one run; stamps of the trace count from the run's first.

    An object that is lost counts up to where a camera on the hand would lose it from sight. The trace is the median of
    the draws that end as most do; the extremes are of all draws.
    """
    rng = np.random.default_rng(seed)
    kept, traces, maxima, minima, slid = [], [], [], [], []
    for standard in members:
        p = values(standard)
        for _ in range(DRAWS):
            motion = simulate(p, pads, rng.standard_normal(2))
            factor = np.exp(discrepancy.log_mean + discrepancy.log_deviation * rng.standard_normal())
            rotation = factor * np.rad2deg(motion.rotation)
            kept.append(lost_at(motion, p) is None)
            gone = np.flatnonzero(motion.slid > OUT_OF_SIGHT)
            if gone.size:
                rotation[gone[0] :] = rotation[max(gone[0] - 1, 0)]
            traces.append(rotation)
            maxima.append(rotation.max() + discrepancy.noise_deg * abs(rng.standard_normal()))
            minima.append(rotation.min() - discrepancy.noise_deg * abs(rng.standard_normal()))
            slid.append(motion.slid[-1])
    share = float(np.mean(kept))
    chosen = np.array(kept) == (share > 0.5)
    typical = np.median(np.array(traces)[chosen], axis=0)
    return Prediction(
        share, pads.time - pads.time[0], typical,
        np.array(maxima), np.array(minima), np.array(slid),
    )  # fmt: skip
