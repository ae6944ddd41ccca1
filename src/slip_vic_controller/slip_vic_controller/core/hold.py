"""HOLD: the posture in which it began, with gravity, the load and damping; gains that bear late messages."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array, skew

EXCESS = 1.5  # times that `held_inertia` may be what is moved
LOAD_LEVER = 0.1  # [m]: how far off the pad centre the unknown part of a load may pull
SLOWEST = 0.45  # of the loop in slow motion: with the default gains no joint gives way under a load that slides


def hold_torque(
    gravity: Array, inertia: Array, q: Array, qd: Array, posture: Array, stiffness: float, damping: float
) -> Array:
    """Return g + M (k (q_0 - q) - d qd); (n,) [N m], (n, n) [kg m2], (n,) [rad], [rad/s], k [1/s^2], d [1/s].

    Implements: ours: the command of HOLD; with the inertia in it one stiffness suits all joints and postures.
    """
    return gravity + inertia.dot(stiffness * (posture - q) - damping * qd)


def held_inertia(M: Array, J: Array, r: Array, mass: float, inertia: Array) -> Array:
    """Return the joint-space inertia with half of a rigidly held object in it; (n, n) [kg m2].

    A wrist joint turns more of the object than of the arm, and the object may be held, slip or be gone. With half of it
    the gains are wrong by a factor of at most 1 + P / 2 M in every case; with all or none of it by the whole ratio.

    Args:
        M: joint-space inertia of the arm; (n, n) [kg m2].
        J: Jacobian at the pad centre; (6, n) {w}.
        r: pad centre as seen from the object's centre of mass; (3,) [m] {w}.
        mass: of the object [kg].
        inertia: about its centre of mass; (3, 3) [kg m2] {w}.

    Implements: ours: M + J_o^T B_o J_o / 2 with J_o of Eq. (14).
    """
    J_v = J[:3] + skew(r).dot(J[3:])
    return M + 0.5 * (mass * J_v.T.dot(J_v) + J[3:].T.dot(inertia).dot(J[3:]))


def load_error(error: Array, model: Array, measured: Array, dt: float, memory_s: float) -> Array:
    """Return what has to be added to the load of the model, from its value before; (6,) [N, N m] {ee} each.

    Slow and bounded by the weight itself, so that HOLD depends on the wrench no more than it must: an object that has
    slid while the arm came to rest pulls at another point than the model says, and the pads would give way and tilt.

    Args:
        error: of the cycle before.
        model: wrench on the pad of a resting object where it is known to be.
        measured: by the wrench sensor.
        dt: since the cycle before [s].
        memory_s: time constant [s].

    Implements: ours: low-pass of the wrench that the model does not explain.
    """
    weight = math.sqrt(model[:3].dot(model[:3]))
    wanted = np.concatenate(
        (_shortened(measured[:3] - model[:3], weight), _shortened(measured[3:] - model[3:], LOAD_LEVER * weight))
    )
    return error + (1.0 - math.exp(-dt / memory_s)) * (wanted - error)


def _shortened(v: Array, most: float) -> Array:
    size = math.sqrt(v.dot(v))
    return v if size <= most else v * (most / size)


def bearable_gains(stiffness: float, damping: float, delay_s: float) -> tuple[float, float]:
    """Return the gains for joint states that are late: the same loop in slow motion, so that its margin stays.

    No slower than `SLOWEST`: a simulation that is behind the wall clock has old stamps without any delay in the loop,
    and an arm without damping does not come to rest.

    Implements: ours: k s^2 and d s have the delay margin of k and d over s; a quarter is left for the rest of the way.
    """
    margin = 0.75 * delay_margin(stiffness, damping, EXCESS)
    s = max(SLOWEST, min(1.0, margin / delay_s)) if delay_s > 0.0 else 1.0
    return s * s * stiffness, s * damping


def delay_margin(stiffness: float, damping: float, excess: float = 1.0) -> float:
    """Return the delay [s] from joint state to effort at which HOLD begins to swing.

    Args:
        stiffness, damping: k [1/s^2], d [1/s].
        excess: how many times the inertia in `hold_torque` is the one that is moved, where the object is gone.

    Implements: ours: the phase margin of excess (d s + k) / s^2 at its crossover, over the crossover frequency.
    """
    k, d = excess * stiffness, excess * damping
    crossover = math.sqrt(0.5 * (d * d + math.sqrt(d**4 + 4.0 * k * k)))
    return math.atan2(damping * crossover, stiffness) / crossover
