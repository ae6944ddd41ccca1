"""What only wrench and motion tell: friction that cannot carry the load, and a slip sensor that sees nothing.

Following a falling object is the law's natural behaviour. So what counts as falling is not slip, which the law keeps
small, but speed gained along gravity beyond what the reference asks for, while there is slip.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_vic_controller.core.guard_kernel import EVIDENCE_MEMORY_S

CANNOT_CARRY = "friction cannot carry the load"


class LoadPolicy(NamedTuple):
    """down (3,): unit vector along gravity {w}, zeros without gravity; drop_speed [m/s]; memory_s [s]."""

    down: Array
    drop_speed: float
    memory_s: float


def make_load_policy(gravity: Array, drop_speed: float, memory_s: float) -> LoadPolicy:
    """Return the policy for gravity (3,) [m/s^2] {w}.

    Implements: ours: without gravity nothing falls.
    """
    g = math.sqrt(float(gravity.dot(gravity)))
    return LoadPolicy(gravity / g if g > 0.0 else np.zeros(3), drop_speed, memory_s)


def fall_speed(
    policy: LoadPolicy,
    speed: float,
    object_acceleration: Array,
    desired_acceleration: Array,
    slip_plane: Array,
    slipping: float,
    dt: float,
) -> float:
    """Return the speed [m/s] that the object has gained along gravity beyond the reference, from `speed` before.

    Accelerations (>= 3,) [m/s^2] {w}, linear part first; slip_plane (3, 3) {w} projects on the directions of slip: in
    the others the pads' normal force carries. slipping in [0, 1]: 0 means that the object is held; dt [s]. The gain
    fades with memory_s, so a bias of the wrench adds up to bias / mass * memory_s and no more.

    Implements: ours: leaky integral of the fall.
    """
    fall = float(slip_plane.dot(policy.down).dot(object_acceleration[:3] - desired_acceleration[:3]))
    return max(0.0, speed * math.exp(-dt / policy.memory_s) + slipping * fall * dt)


def cannot_carry(policy: LoadPolicy, speed: float) -> str:
    """Return what is wrong where the gained speed [m/s] is too high, else an empty text.

    Implements: ours: above this no law can stop the slip.
    """
    if speed <= policy.drop_speed:
        return ""
    return f"{CANNOT_CARRY}: it has gained {speed:.2f} m/s of fall"


class EvidenceState(NamedTuple):
    """velocity (3,) [m/s] {w}: slip that motion and wrench add up to; twist (6,) {w}: of {ee} at the last tick."""

    velocity: Array
    twist: Array


def slip_evidence(
    state: EvidenceState | None,
    twist: Array,
    follow: Array,
    slip_axes_world: Array,
    dt: float,
    memory_s: float = EVIDENCE_MEMORY_S,
) -> EvidenceState:
    """Add up a_ee - G^T a_o over the last `memory_s`; twist of {ee} (6,), follow = G^T a_o + Phi2 (6,) {w}.

    slip_axes_world (3, 3) projects the linear part on the directions in which the contact can slip.

    Implements: ours: Eq. (17) without its small terms, as a leaky integral, because a bias must not grow.
    """
    if state is None or dt <= 0.0:
        return EvidenceState(np.zeros(3), twist)
    step = slip_axes_world.dot((twist - state.twist)[:3] - dt * follow[:3])
    return EvidenceState(state.velocity * math.exp(-dt / memory_s) + step, twist)
