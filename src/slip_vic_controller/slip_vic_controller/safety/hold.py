"""HOLD: the posture in which it began, with gravity, the load and damping; gains that are stable with late messages."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Mat3, Real, Record, Vec3, Vec6, Whole, dtype_of
from slip_core.vectors import Mat, Spatial, Vec, mat, put_spatial, spatial, vec
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.safety.validation import JointRecord
from slip_vic_controller.sizes import MAX_JOINTS, Joints

EXCESS = 1.5  # times that the inertia in HOLD may be what is moved
LOAD_LEVER = 0.1  # [m]: how far off the pad centre the unknown part of a load may pull; no pad is longer
LEAST_LOAD = 5.0  # [N]: what one arm carries at least, where the wrench shows it: a mass that is told too small
RESTS = 0.02  # [rad/s]: speed of a joint at rest, with the noise of its sensor
RESTS_FOR = 0.05  # [s]: friction holds a joint that is at rest for that long
ELSEWHERE = 0.01  # [rad]: off the posture that HOLD keeps; a pad has then moved by some millimetres
LOAD_S = 0.05  # [s]: time constant with which HOLD takes from the wrench the load that the model does not explain
SLOWEST = 0.45  # of the loop in slow motion: with the default gains no joint gives way under a load that slides


class HoldConfig(Record):
    """Gains of HOLD, and the object; of several pads each carries its share of it."""

    joints: Whole  # in use
    carriers: Whole  # pads that carry the object, those of other arms too
    stiffness: Real  # 1/s^2; over the joint inertia
    damping: Real  # 1/s; over the joint inertia
    load_s: Real  # s; how fast the load is taken from the wrench
    least_load: Real  # N; most that is taken from it, where the weight is less
    mass: Real  # kg
    inertia: Mat3  # kg m2 {o}
    weight: Vec3  # N {w}


HOLD_CONFIG = dtype_of(HoldConfig)


class Hold(Record):
    """What HOLD keeps."""

    known: Whole
    posture: Joints  # rad
    thrown_s: Joints  # s; for which a joint of an arm that was thrown has yet to rest, 0 where it was not
    load_error: Vec6  # N, N m {ee}; what is added to the model's load


HOLD = dtype_of(Hold)


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
def load_error(error: Spatial, model: Spatial, measured: Spatial, dt: float, memory_s: float, least: float) -> Spatial:
    """Return what has to be added to the load of the model, from its value before; [N, N m] {ee} each.

    Low-pass of the wrench that the model does not explain. Slow and bounded by the weight itself, or by `least`,
    so that HOLD depends on the wrench no more than it must: an object that has slid while the arm came to rest pulls at
    another point than the model says, and the pads would give way and tilt.

    Args:
        error: of the cycle before.
        model: wrench on the pad of a resting object where it is known to be.
        measured: by the wrench sensor.
        dt: since the cycle before [s].
        memory_s: time constant [s].
        least: most that it is where the weight is less [N].
    """
    most, beyond = max(model.linear.norm(), least), measured - model
    wanted = Spatial(_shortened(beyond.linear, most), _shortened(beyond.angular, LOAD_LEVER * most))
    return error + (1.0 - math.exp(-dt / memory_s)) * (wanted - error)


@part
def update_load_error(config: HoldConfig, state: Hold, arm: Arm, r_pad: Vec, measured: Spatial, dt: float) -> None:
    """Take the measured wrench on the own pad {ee} into the load of HOLD; r_pad: as in `hold_effort`; dt [s]."""
    R = mat(arm.rotation)
    load = object_load(config, R, R @ r_pad)
    error = load_error(spatial(state.load_error), load, measured, dt, config.load_s, config.least_load)
    put_spatial(state.load_error, error)


@part
def _shortened(v: Vec, most: float) -> Vec:
    size = v.norm()
    return v if size <= most else (most / size) * v


@part
def gains_for_delay(stiffness: float, damping: float, delay_s: float) -> tuple[float, float]:
    """Return the gains for joint states that are late: the same loop in slow motion, so that its margin stays.

    k s^2 and d s have the delay margin of k and d over s; a quarter is left for the rest of the way. No slower than
    SLOWEST: a simulation that is behind the wall clock has old stamps without any delay in the loop, and an arm without
    damping does not come to rest.
    """
    s = 1.0
    if delay_s > 0.0:
        s = max(SLOWEST, min(1.0, 0.75 * delay_margin(stiffness, damping, EXCESS) / delay_s))
    return s * s * stiffness, s * damping


@part
def delay_margin(stiffness: float, damping: float, excess: float) -> float:
    """Return the delay [s] from joint state to effort at which HOLD begins to swing.

    The phase margin of excess (d s + k) / s^2 at its crossover, over the crossover frequency.

    Args:
        stiffness, damping: k [1/s^2], d [1/s].
        excess: how many times the inertia in HOLD is the one that is moved, where the object is gone.
    """
    k, d = excess * stiffness, excess * damping
    crossover = math.sqrt(0.5 * (d * d + math.sqrt(d * d * d * d + 4.0 * k * k)))
    return math.atan2(damping * crossover, stiffness) / crossover if crossover > 0.0 else math.inf


@part
def add_inertia_torque(config: HoldConfig, arm: Arm, R_o: Mat, r: Vec, qdd: Array, torque: Array) -> None:
    """Add (M + J_o^T B_o J_o / 2) qdd to `torque` (n,): a joint acceleration with half of a rigidly held object in it.

    A wrist joint turns more of the object than of the arm, and the object may be held, slip or be gone. With half of it
    the gains are wrong by a factor of at most 1 + P / 2 M in every case; with all or none of it by the whole ratio.

    Args:
        config: of HOLD.
        arm: its terms.
        R_o: attitude of the object.
        r: pad centre as seen from the object's centre of mass [m] {w}.
        qdd: (n,) [rad/s^2].
        torque: changed.
    """
    n, a, w = config.joints, Vec(0.0, 0.0, 0.0), Vec(0.0, 0.0, 0.0)
    for j in range(n):
        a = a + qdd[j] * Vec(arm.J[0, j], arm.J[1, j], arm.J[2, j])
        w = w + qdd[j] * Vec(arm.J[3, j], arm.J[4, j], arm.J[5, j])
    # With J_o of Eq. (14): the object's acceleration is a + r x w, and what it takes acts at the pad.
    force = config.mass * (a + r.cross(w))
    moment = R_o @ (mat(config.inertia) @ (R_o.T() @ w)) + force.cross(r)
    for j in range(n):
        total = 0.0
        for k in range(n):
            total += arm.M[j, k] * qdd[k]
        total += 0.5 * (force.x * arm.J[0, j] + force.y * arm.J[1, j] + force.z * arm.J[2, j])
        total += 0.5 * (moment.x * arm.J[3, j] + moment.y * arm.J[4, j] + moment.z * arm.J[5, j])
        torque[j] += total


@part
def hold_effort(
    config: HoldConfig, state: Hold, arm: Arm, sample: JointRecord, pad: Mat, r_pad: Vec, late_s: float, torque: Array
) -> None:
    """Write g + M (k (q_0 - q) - d qd) to `torque`; with the inertia in it one stiffness suits all joints.

    Args:
        config, state: of HOLD.
        arm: its terms.
        sample: position and velocity of the joints; [rad], [rad/s].
        pad: attitude of the pad in the object.
        r_pad: pad centre as seen from the object's centre of mass [m] {ee}.
        late_s: how late joint states are [s].
        torque: result; (n,) [N m].
    """
    k, d = gains_for_delay(config.stiffness, config.damping, late_s)
    qdd = np.empty(MAX_JOINTS)
    for j in range(config.joints):
        torque[j] = arm.gravity[j]
        qdd[j] = k * (state.posture[j] - sample.position[j]) - d * sample.velocity[j]
    R = mat(arm.rotation)
    add_inertia_torque(config, arm, R @ pad.T(), R @ r_pad, qdd, torque)


@part
def begin_posture(config: HoldConfig, state: Hold, sample: JointRecord) -> None:
    """Begin with the posture in which the joints are; config, state: of HOLD; sample: of the joints [rad]."""
    state.known = 1
    for j in range(config.joints):
        state.posture[j], state.thrown_s[j] = sample.position[j], 0.0


@part
def keep_posture(
    config: HoldConfig, state: Hold, sample: JointRecord, velocity_limit: Array, M: Array, friction: Array, dt: float
) -> None:
    """Let a joint that was thrown rest where it becomes slow again: the way back would be as fast as it is allowed.

    What throws one joint moves all of them, and passes. So each stays, once, where it turns round or comes to rest; an
    arm that gives way to a load would do so step by step.

    So may one that has come to rest elsewhere and that friction can hold there: else the compensation of disturbances
    grows against friction until the joint breaks loose, long after everything has come to rest. Two joints with
    parallel axes that are off against each other pull little at either, so the pull of all joints counts.

    Args:
        config: of HOLD.
        state: of HOLD; changed.
        sample: position and velocity of the joints; [rad], [rad/s].
        velocity_limit: (n,) [rad/s].
        M: inertia (n, n) [kg m2].
        friction: of the joints, as configured (n,) [N m].
        dt: since the cycle before [s].
    """
    n = config.joints
    off = state.posture[:n] - sample.position[:n]
    for j in range(n):
        if abs(sample.velocity[j]) > velocity_limit[j]:
            state.thrown_s[:n] = RESTS_FOR
    for j in range(n):
        speed, pull = abs(sample.velocity[j]), 0.0
        for k in range(n):
            pull += config.stiffness * M[j, k] * off[k]
        elsewhere, rests = abs(off[j]) > ELSEWHERE, speed < RESTS
        stays = speed > velocity_limit[j] or (elsewhere and rests and abs(pull) < friction[j])
        if state.thrown_s[j] > 0.0 and elsewhere and (rests or off[j] * sample.velocity[j] > 0.0):
            state.thrown_s[j] = state.thrown_s[j] - dt if rests else 0.0
            stays = stays or state.thrown_s[j] <= 0.0
        if stays:
            state.posture[j] = sample.position[j]


@part
def carry_load(config: HoldConfig, state: Hold, arm: Arm, r_pad: Vec, torque: Array) -> None:
    """Add -J^T h to `torque` (n,) [N m]: the load of an object that does not fall; arguments as in `hold_effort`."""
    R = mat(arm.rotation)
    h = R @ (object_load(config, R, R @ r_pad) + spatial(state.load_error))
    for j in range(config.joints):
        torque[j] -= arm.J[0, j] * h.linear.x + arm.J[1, j] * h.linear.y + arm.J[2, j] * h.linear.z
        torque[j] -= arm.J[3, j] * h.angular.x + arm.J[4, j] * h.angular.y + arm.J[5, j] * h.angular.z
