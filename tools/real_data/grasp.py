"""The soft grasp of the data set: parameters with their priors, and a simulated run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.records import new, record
from slip_sim_bridge.friction import lugre
from tools.real_data.runs import PadMotion
from tools.real_data.soft_grasp import COLUMNS, OBJECT, G, carry

STEP_S = 2e-3


class Prior(NamedTuple):
    """What is thought of a parameter before any run is looked at: normal in the transformed value."""

    middle: float
    deviation: float
    kind: str = "log"  # or linear, share (logit)

    def value(self, standard: float) -> float:
        """Return the value at so many deviations from the middle."""
        if self.kind == "linear":
            return self.middle + self.deviation * standard
        if self.kind == "log":
            return float(self.middle * np.exp(self.deviation * standard))
        odds = self.middle / (1.0 - self.middle) * np.exp(self.deviation * standard)
        return float(odds / (1.0 + odds))


PRIORS = {
    "lever": Prior(0.08, 0.4),  # m: a box of a hand's size
    "gyration": Prior(0.06, 0.3),  # m
    "gain": Prior(1.0, 0.15),  # of the pads' acceleration over that of the joint encoders: joints, hand and pads give
    "tilt": Prior(0.0, 0.03, "linear"),  # rad: placed by hand; mean of all runs
    "margin": Prior(0.15, 0.7),  # break-away force over weight, less 1: a grasp made to be weak
    "kinetic_share": Prior(0.85, 0.8, "share"),  # of the break-away force that is left in sliding
    "stribeck_velocity": Prior(0.01, 1.2),  # m/s
    "viscous": Prior(0.4, 1.2),  # 1/s, per mass
    "torsional_radius": Prior(0.0067, 0.25),  # m: two thirds of the pads' half width of 10 mm, uniform pressure
    "stiffness": Prior(4e4, 0.7),  # 1/s^2, per mass: the weight shears the skin by a quarter of a millimetre
    "damping": Prior(500.0, 1.5),  # 1/s, per mass
    "breakaway_fraction": Prior(0.8, 1.2, "share"),
    "thinning": Prior(10.0, 0.5),  # 1/m: normal counts fall by an eighth over 10 mm
    "release": Prior(0.024, 0.15),  # m: the marker begins to fall freely there
    "lag": Prior(0.02, 0.015, "linear"),  # s, of the marker's stamps behind the arm's
    "marker_ahead": Prior(-0.04, 0.01, "linear"),  # m, of the marker from the pad centre
}
NAMES = tuple(PRIORS)
TILT_OF_RUN, GRIP_OF_RUN = 0.02, 0.03
"""How much a grasp differs from the mean grasp: tilt [rad], and friction over weight, as a share."""
MARKER_UP = 0.022  # m, of the marker from the pad centre: its small way up and down hardly shows it
OUT_OF_SIGHT = 0.075  # m: an object that has fallen so far is no longer seen by the camera on the hand


class Motion(NamedTuple):
    """Simulated motion at the stamps of a run, as the marker shows it; each (n,)."""

    rotation: Array  # rad
    ahead: Array  # m
    down: Array  # m
    slid: Array  # m


def values(standard: Array) -> dict[str, float]:
    """Return the parameters from deviations of their priors; (len(NAMES),)."""
    return {name: PRIORS[name].value(z) for name, z in zip(NAMES, standard, strict=True)}


def simulate(p: dict[str, float], pads: PadMotion, of_run: Array) -> Motion:
    """Simulate a run.

    Args:
        p: the parameters, as `values` returns them.
        pads: motion of the pads.
        of_run: how its grasp differs from the mean, in deviations: tilt, grip; (2,).
    """
    tilt = p["tilt"] + TILT_OF_RUN * of_run[0]
    grip = G * (1.0 + p["margin"]) * np.exp(GRIP_OF_RUN * of_run[1])
    numbers, friction = new(OBJECT), new(lugre.LAYOUT)
    thing, law = record(numbers, OBJECT), record(friction, lugre.LAYOUT)
    thing.lever, thing.gyration, thing.tilt = p["lever"], p["gyration"], tilt
    thing.thinning, thing.release = p["thinning"], p["release"]
    law.curve.mu_s, law.curve.mu_k = grip, grip * p["kinetic_share"]
    law.curve.stribeck_velocity, law.curve.viscous = p["stribeck_velocity"], p["viscous"]
    law.stiffness, law.damping = p["stiffness"], p["damping"]
    law.breakaway_fraction, law.torsional_radius = p["breakaway_fraction"], p["torsional_radius"]

    time = np.ascontiguousarray(pads.time)
    acceleration = p["gain"] * np.interp(time - p["lag"], time, pads.acceleration)
    motion = np.empty((time.size, COLUMNS))
    carry(numbers, friction, time, acceleration, STEP_S, motion)
    angle, c, s = motion[:, 0], np.cos(motion[:, 0]), np.sin(motion[:, 0])
    marker = np.array([p["marker_ahead"], MARKER_UP])
    arm = marker - motion[0, 1:3]
    ahead = motion[:, 1] + c * arm[0] - s * arm[1] - marker[0]
    up = motion[:, 2] + s * arm[0] + c * arm[1] - marker[1]
    return Motion(-angle, ahead, -up, motion[:, 3])


def lost_at(motion: Motion, p: dict[str, float]) -> int | None:
    """Return the row at which the object has left the pads, None where it is kept."""
    gone = np.flatnonzero(motion.slid >= p["release"])
    return int(gone[0]) if gone.size else None
