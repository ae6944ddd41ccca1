"""The picture of docs/real_runs.md."""

from __future__ import annotations

import io
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image

mpl.use("Agg")
import matplotlib.pyplot as plt

from tools.real_data.cross import predictions
from tools.real_data.limit import Timing

PICTURE = Path(__file__).parents[2] / "docs" / "pictures" / "real_runs.png"
RED, BLUE, GREY = "#c0392b", "#2471a3", "#7f8c8d"
DPI = 110
COLOURS = 64  # of the file: a third of its size


def draw(found: list[Timing]) -> None:
    """Draw measured and predicted rotation of every run, and the governor's timing of the path."""
    figure, axes = plt.subplots(2, 4, figsize=(13.0, 5.6), height_ratios=(1.2, 1.0))
    left_out = predictions()
    for axis, (run, prediction) in zip(axes[0], left_out, strict=True):
        p = prediction.json()
        axis.plot(run.time, run.rotation, color="black", lw=1.2, label="marker")
        axis.plot(prediction.time, prediction.rotation, color=BLUE, lw=1.2, label="predicted from the other runs")
        for name in ("max_deg_80", "min_deg_80"):
            axis.axhspan(*p[name], color=BLUE, alpha=0.12, lw=0)
        outcome = "kept" if run.kept else "lost"
        axis.set_title(
            f"{np.percentile(run.acceleration, 97):.2f} m/s², {outcome}; P(kept) = {prediction.probability_kept:.2f}",
            fontsize=9,
        )
        axis.set_xlabel("s")
    axes[0, 0].set_ylabel("rotation in the grasp [deg]")
    axes[0, 0].legend(fontsize=7, loc="lower left")
    lost = next(run for run, _ in left_out if not run.kept)
    for axis, one in zip(axes[1], found, strict=False):
        start = one.governed.time[np.argmax(one.governed.speed > 0.01)]
        begin = lost.time[np.argmax(lost.pads().speed > 0.01)]
        axis.plot(lost.time - begin, lost.pads().speed, color=RED, lw=1.2, label="as it was run (lost)")
        axis.plot(one.governed.time - start, one.governed.speed, color="#1e8449", lw=1.2, label="governed")
        axis.set_xlim(-0.2, one.governed_s + 0.2)
        slower = 100.0 * (one.governed_s / one.planned_s - 1.0)
        axis.set_title(
            f"slip learnt at {abs(one.learnt.acceleration):.2f} m/s²: {slower:+.0f} % time, "
            f"P(kept) = {one.predicted.probability_kept:.2f}",
            fontsize=8,
        )
        axis.set_xlabel("s")
    axes[1, 0].set_ylabel("speed of the pads [m/s]")
    axes[1, 0].legend(fontsize=7)
    for axis in axes.flat:
        axis.grid(alpha=0.3)
        axis.tick_params(labelsize=7)
    figure.tight_layout()
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=DPI, metadata={"Software": None})
    plt.close(figure)
    Image.open(drawn).convert("RGB").quantize(COLOURS).save(PICTURE, optimize=True)
