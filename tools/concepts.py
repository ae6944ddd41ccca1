"""Draw the pictures of docs/concepts.md: from the formulas, and from runs of the suite itself.

python tools/concepts.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("svg")
import matplotlib.pyplot as plt
from matplotlib.patches import Circle, Ellipse, FancyArrowPatch, Polygon, Rectangle

from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import Law, load

PICTURES = Path(__file__).parents[1] / "docs" / "pictures"
SCENARIO, DURATION = "paper_planar", "bridge.duration_s=3.0"
RED, BLUE = "#c0392b", "#2471a3"
COLOURS = {"classical": RED, "vic": BLUE, "governed": "#1e8449"}
STYLE = {"svg.hashsalt": "slip-vic", "font.size": 9.0, "axes.spines.top": False, "axes.spines.right": False}


def save(figure: plt.Figure, name: str) -> None:
    """Write one picture without a date, so that it changes only where its content does."""
    figure.tight_layout()
    figure.savefig(PICTURES / f"{name}.svg", metadata={"Date": None})
    plt.close(figure)


def arrow(axes: plt.Axes, start: tuple[float, float], end: tuple[float, float], colour: str, text: str) -> None:
    """Draw an arrow with its name at the end."""
    axes.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=12, color=colour, linewidth=1.6))
    place = (4, -12) if end[1] < start[1] else (4, 4)
    axes.annotate(text, end, textcoords="offset points", xytext=place, color=colour)


def frames() -> None:
    """The pad on the object: frames, wrench and slip velocity."""
    figure, axes = plt.subplots(figsize=(6.0, 2.8))
    axes.add_patch(Polygon([(0.2, 1.1), (1.6, 1.25), (1.6, 1.65), (0.2, 1.8)], color="#bbbbbb"))
    axes.add_patch(Rectangle((1.5, 1.0), 1.9, 0.9, facecolor="#f5d9a8", edgecolor="#b9770e"))
    axes.add_patch(Circle((1.9, 1.45), 0.16, color="#666666", zorder=3))
    arrow(axes, (1.9, 1.45), (2.75, 1.45), BLUE, "x: approach")
    arrow(axes, (1.9, 1.45), (1.9, 2.2), BLUE, "y")
    axes.text(2.0, 1.68, "z: pads' normal,\nout of the page", color=BLUE, fontsize=7)
    arrow(axes, (1.9, 1.45), (1.25, 0.7), RED, "slip velocity $v_s$: of the pad relative to the object")
    axes.plot(2.3, 1.2, "+", color="#b9770e", markersize=10)
    axes.text(2.38, 1.08, "object, its\ncentre of mass", color="#b9770e", fontsize=7)
    axes.text(0.25, 1.4, "hand", fontsize=8)
    axes.set(xlim=(0, 4.4), ylim=(0.5, 2.5), aspect="equal")
    axes.axis("off")
    save(figure, "concept_frames")


def fading() -> None:
    """What slip velocity does to stiffness, damping and activation; the formulas are Eq. (29)."""
    gains = load(SCENARIO, law="vic").controller.gains
    speed = np.linspace(0.0, 0.05, 300)
    figure, axes = plt.subplots(figsize=(6.0, 2.6))
    axes.plot(1e3 * speed, np.exp(-gains.gamma_kp * speed), color=BLUE, label="stiffness, damping / full value")
    axes.plot(1e3 * speed, np.tanh(gains.alpha * speed), color=RED, label="slip activation")
    axes.set(xlabel="slip speed [mm/s]", ylabel="share", ylim=(0, 1.05))
    axes.legend(frameon=False)
    save(figure, "concept_fading")


def runs() -> None:
    """Slip, and load over friction, of the three controllers on one task."""
    figure, (slip, load) = plt.subplots(2, 1, figsize=(6.0, 4.4), sharex=True)
    kinds: tuple[Law, ...] = ("classical", "vic", "governed")
    for kind in kinds:
        scenario = load(SCENARIO, law=kind, set=[DURATION])
        times, slips, loads = [], [], []
        friction = scenario.bridge.friction
        for tick in run_in_process(scenario):
            times.append(1e-9 * tick.outputs.stamp_ns)
            slips.append(1e3 * float(np.linalg.norm(tick.outputs.truth.slip_displacement[:3])))
            h = tick.outputs.arms[0].wrenches[-1].wrench
            most = friction.mu_s * scenario.bridge.grip.force
            loads.append(float(np.linalg.norm((h[0], h[1], h[5] / friction.torsional_radius))) / most)
        slip.semilogy(times, np.maximum(slips, 1e-4), color=COLOURS[kind], label=kind)
        load.plot(times, loads, color=COLOURS[kind])
    load.axhline(1.0, color="black", linewidth=0.8, linestyle="--")
    load.text(0.02, 1.03, "friction limit", fontsize=7)
    slip.set(ylabel="slip [mm]", ylim=(1e-4, 1e2))
    load.set(xlabel="time [s]", ylabel="load / friction limit", ylim=(0, 1.25))
    slip.legend(frameon=False, ncols=3)
    save(figure, "concept_runs")


def limit_surface() -> None:
    """Force and torque that friction can carry together."""
    friction = load(SCENARIO, law="vic").bridge.friction
    grip = load(SCENARIO, law="vic").bridge.grip.force
    most = friction.mu_s * grip
    torque = 1e3 * friction.torsional_radius * most
    figure, axes = plt.subplots(figsize=(6.0, 2.8))
    axes.add_patch(Ellipse((0, 0), 2 * most, 2 * torque, facecolor="#d5f5e3", edgecolor="#1e8449"))
    axes.add_patch(Ellipse((0, 0), 1.9 * most, 1.9 * torque, fill=False, edgecolor="#1e8449", linestyle="--"))
    axes.annotate("sticks", (0.0, 0.0), ha="center")
    axes.annotate("slips", (0.93 * most, 0.8 * torque), color=RED)
    axes.annotate(
        "0.95: what the governor asks at most", (0.0, -0.75 * torque), ha="center", color="#1e8449", fontsize=7
    )
    axes.set(xlabel="friction force [N]", ylabel="friction torque [N mm]", xlim=(-1.3 * most, 1.3 * most))
    axes.set_ylim(-1.3 * torque, 1.3 * torque)
    save(figure, "concept_limit_surface")


if __name__ == "__main__":
    with plt.rc_context(STYLE):
        frames()
        fading()
        limit_surface()
        runs()
