"""HOLD: the posture in which it began, with gravity, the load and damping. It needs joint states alone."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Mat3, Real, Record, Vec3, Whole, WholeArray
from slip_core.vectors import ZERO, Mat, Spatial, Vec, mat, vec
from slip_vic_controller.arm.estimator import MOVES, SLOW_S, JointRecord
from slip_vic_controller.law.arm import Arm, column
from slip_vic_controller.sizes import MAX_JOINTS, Joints

DELAY = 0.46
"""Natural frequency of HOLD times the delay from joint state to effort at which it begins to swing, where what is moved
is 1.5 times the inertia that it reckons with, as where the object is gone [rad]."""
LOAD_LEVER = 0.1
"""How far off its configured place a load may pull: no pad is longer [m]."""
ELSEWHERE = 0.01
"""Distance from the posture that HOLD keeps, by which a pad has moved by some millimetres [rad]."""


class HoldConfig(Record):
    """Gains of HOLD, and the object; of several pads each carries its share of it."""

    joints: Whole  # in use
    carriers: Whole  # pads that carry the object, those of other arms too
    rate: Real  # 1/s; natural frequency
    fastest: Real  # 1/s; largest that the delay admits for the inertia that HOLD assumes
    mass: Real  # kg
    inertia: Mat3  # kg m2 {o}
    weight: Vec3  # N {w}


class Hold(Record):
    """What HOLD keeps."""

    known: Whole
    posture: Joints  # rad


@part
def fill_hold(config: HoldConfig, mass: float, inertia: Array, gravity: Array, stiffness: float, delay: float) -> None:
    """Let HOLD use an object and a stiffness, and the rate that the delay admits.

    Args:
        config: changed; `carriers` share the object.
        mass, inertia, gravity: of the object [kg]; (3, 3) [kg m2]; (3,) [m/s^2] {w}.
        stiffness: as configured, over the joint inertia [1/s^2].
        delay: from a joint state to the effort, as far as it is not foreseen [s].
    """
    share, config.rate, config.fastest = 1.0 / config.carriers, math.sqrt(stiffness), 0.5 * DELAY / delay
    config.mass = share * mass
    for i in range(3):
        config.weight[i] = config.mass * gravity[i]
        for j in range(3):
            config.inertia[i, j] = share * inertia[i, j]


@part
def object_load(config: HoldConfig, R: Mat, r: Vec) -> Spatial:
    """Return the wrench on the pad of a resting object; R: pad to {w}; r = x_c - x_o {w} -> {ee}."""
    weight = vec(config.weight)
    return R.T() @ Spatial(weight, -r.cross(weight))


@part
def plausible_arm(configured: Vec, r_pad: Vec) -> Vec:
    """Return r_pad, no farther than LOAD_LEVER from where it is configured; [m], on any axes.

    A slip velocity that is wrong adds up to any distance, and the inertia of an object metres away makes HOLD swing.
    """
    far = (r_pad - configured).norm()
    return r_pad if far <= LOAD_LEVER else configured + (LOAD_LEVER / far) * (r_pad - configured)


@part
def _wrench_of(config: HoldConfig, R_o: Mat, r: Vec, motion: Spatial) -> Spatial:
    """Return the wrench at the pad of an object that moves with it; r: x_c - x_o [m] {w}, motion: acceleration {w}."""
    w = motion.angular
    force = config.mass * (motion.linear + r.cross(w))
    return Spatial(force, R_o @ (mat(config.inertia) @ (R_o.T() @ w)) + force.cross(r))


@part
def hold_effort(
    config: HoldConfig, state: Hold, arm: Arm, sample: JointRecord, pad: Mat, r_pad: Vec, torque: Array
) -> None:
    """Write g + (M + J_o^T B_o J_o / 2) (k (q_0 - q) - d qd) to `torque`: one stiffness suits all joints.

    A wrist joint turns more of the object than of the arm, and the object may be held, slip or be gone. With half of it
    the gains are wrong by a factor of at most 1 + P / 2 M in every case; with all or none of it by the whole ratio. The
    rate is low enough for that factor. Damping is critical.

    Args:
        config, state: of HOLD.
        arm: its terms.
        sample: position and velocity of the joints; [rad], [rad/s].
        pad: attitude of the pad in the object.
        r_pad: pad centre as seen from the object's centre of mass [m] {ee}.
        torque: result; (n,) [N m].
    """
    n, motion, qdd, factor = config.joints, Spatial(ZERO, ZERO), np.empty(MAX_JOINTS), 1.0
    # With J_o of Eq. (14): the object's acceleration is a + r x w, and what it takes acts at the pad.
    R = mat(arm.rotation)
    R_o, r = R @ pad.T(), R @ r_pad
    for j in range(n):
        held = _wrench_of(config, R_o, r, column(arm, j)).dot(column(arm, j))
        factor = max(factor, 1.0 + 0.5 * held / arm.M[j, j])
    rate = min(config.rate, config.fastest / factor)
    for j in range(n):
        qdd[j] = rate * (rate * (state.posture[j] - sample.position[j]) - 2.0 * sample.velocity[j])
        motion = motion + qdd[j] * column(arm, j)
    h = _wrench_of(config, R_o, r, motion)
    for j in range(n):
        torque[j] = arm.gravity[j] + 0.5 * h.dot(column(arm, j))
        for i in range(n):
            torque[j] += arm.M[j, i] * qdd[i]


@part
def keep_posture(
    config: HoldConfig, state: Hold, sample: JointRecord, limited: WholeArray, M: Array, friction: Array, dt: float
) -> None:
    """Move the posture to where a joint is: at once if its effort is limited, within SLOW_S if it rests elsewhere.

    A posture that pulls while the effort cannot follow makes HOLD swing up, and the way back of a joint that was thrown
    would be as fast as it is allowed. And against friction the compensation of disturbances grows until the joint
    breaks loose, long after everything has come to rest. Two joints with parallel axes that are off against each other
    pull little at either, so the pull of all joints counts. A load may balance the pull too, for example an object that
    has turned on the pad: without the pull, the joint would start to move again.

    Args:
        config, state: of HOLD; the state is changed.
        sample: position and velocity of the joints; [rad], [rad/s].
        limited: which joints get another effort than HOLD needs, by size or rate; (n,) 0 or 1.
        M: inertia (n, n) [kg m2].
        friction: of the joints, as configured (n,) [N m].
        dt: period [s].
    """
    n = config.joints
    off = state.posture[:n] - sample.position[:n]
    for j in range(n):
        speed, pull = abs(sample.velocity[j]), 0.0
        for k in range(n):
            pull += config.rate * config.rate * M[j, k] * off[k]
        rests = abs(off[j]) > ELSEWHERE and speed < MOVES and abs(pull) < friction[j]
        if limited[j] != 0:
            state.posture[j] = sample.position[j]
        elif rests:
            state.posture[j] -= min(dt / SLOW_S, 1.0) * off[j]  # as fast as disturbances are learnt


@part
def carry_load(config: HoldConfig, arm: Arm, r_pad: Vec, torque: Array) -> None:
    """Add -J^T h to `torque` (n,) [N m]: the load of an object that does not fall; arguments as in `hold_effort`."""
    R = mat(arm.rotation)
    h = R @ object_load(config, R, R @ r_pad)
    for j in range(config.joints):
        torque[j] -= h.dot(column(arm, j))
