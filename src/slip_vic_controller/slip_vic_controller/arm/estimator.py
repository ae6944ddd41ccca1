"""Joint state estimator: position, velocity and disturbance of every joint, from noisy samples and the arm's model.

Per joint a Kalman filter in steady state. Its state is x = (q, v, d); d is the acceleration that the model leaves out:
friction, torque offset, a push. Its input u is what the joint is known to do. With efforts that is the acceleration

    u = M^-1 (tau_sent - C qd - g + J^T h_ee)

with a velocity drive the commanded velocity, which the drive follows with bandwidth b:

    q' = v,   v' = u + d  (efforts, b = 0),   v' = b (u - v) + d  (velocity drive),   d' = noise.

The disturbance is slow, except where friction turns round or something touches the arm: then innovations of one sign
come in a row, and a filter with a faster drift takes over.

Measured are q and v, by a sensor that is late by a known latency: the filter runs at the time of measurement, with the
inputs of that time, and its estimate is predicted to now with the inputs since then. Everything that follows in a cycle
works with this prediction.

Which measurements of a joint are used is decided in `plausibility`.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple, Protocol

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_vic_controller.arm.joint_estimate import (
    LONGEST_STEP,
    QUICK,
    RING,
    EstimatorConfig,
    JointEstimate,
    Trust,
)
from slip_vic_controller.arm.plausibility import (
    compare_measurements,
    count_unmeasured,
    is_unmeasured,
    joint_repeats,
)
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.sizes import MAX_JOINTS

FAST: Final = 20.0
"""Distance of the velocity from the measured one [rad/s] from which an estimate is none: the forces of the model grow
with the square of velocity, so one that runs away doubles its exponent in every cycle."""


class PadVariances(Protocol):
    """Variances of a pad's twist and of the noise in its change over a period; (6,) [m/s, rad/s]^2."""

    velocity_variance: Array
    change_variance: Array


class JointSampleLike(Protocol):
    """A joint state: stamp [ns], position [rad] and velocity [rad/s]."""

    stamp_ns: int
    position: Array
    velocity: Array


class Transition(NamedTuple):
    """q <- q + qv v + qd d + qu u, v <- vv v + vd d + vu u over a time."""

    qv: float
    qd: float
    qu: float
    vv: float
    vd: float
    vu: float


@part
def transition(bandwidth: float, dt: float) -> Transition:
    """Return the exact transition of a joint over `dt` [s] with constant input and disturbance; bandwidth [rad/s]."""
    if bandwidth == 0.0:
        return Transition(dt, 0.5 * dt * dt, 0.5 * dt * dt, 1.0, dt, dt)
    kept = math.exp(-bandwidth * dt)
    qv = (1.0 - kept) / bandwidth
    return Transition(qv, (dt - qv) / bandwidth, dt - qv, kept, qv, 1.0 - kept)


@part
def move_on(step: Transition, q: float, v: float, d: float, u: float) -> tuple[float, float]:
    """Return position [rad] and velocity [rad/s] after a transition with input u and disturbance d."""
    return q + step.qv * v + step.qd * d + step.qu * u, step.vv * v + step.vd * d + step.vu * u


@part
def start_estimate(config: EstimatorConfig, state: JointEstimate, stamp_ns: int, q: Array, qd: Array) -> None:
    """Begin at a sample; (n,) [rad], [rad/s]. The disturbance stays: friction and offset outlast a pause."""
    state.started, state.stamp_ns, state.renewed_ns = 1, stamp_ns, stamp_ns
    state.since, state.newest, state.remembered = 0, 0, 0
    state.inputs[:] = 0.0
    for j in range(config.joints):
        position, velocity = q[j], qd[j]
        if state.unmeasured[j] > 0 and joint_repeats(state, j, q, qd) and math.isfinite(state.position[j]):
            # It is still where the model had it, and something has held it meanwhile.
            position, velocity = state.position[j], 0.0
        else:
            state.unmeasured[j] = 0
        state.q[j] = state.position[j] = position
        state.v[j] = state.velocity[j] = velocity
        state.measured_position[j], state.measured_velocity[j] = q[j], qd[j]
        state.parity[:, j] = state.moved[:, j] = state.swept[:, j] = 0.0
        state.began[:, j] = qd[j]
        state.same_position[j] = state.same_velocity[j] = 0
        state.mean_q[j], state.mean_v[j], state.quick[j] = 0.0, 0.0, 0
        if config.bandwidth > 0.0:
            for k in range(RING):
                state.inputs[k, j] = velocity


@part
def input_of(config: EstimatorConfig, state: JointEstimate, ago: int, j: int) -> float:
    """Return the input of joint j that was at work `ago` periods before the last one; drives take it up late."""
    k = state.newest - ago - config.drive_ticks
    return state.inputs[k if k >= 0 else k + RING, j]


@part
def remember_input(config: EstimatorConfig, state: JointEstimate, u: Array) -> None:
    """Keep what the joints do from now on; (n,) [rad/s^2], with velocity drives [rad/s]."""
    state.newest = state.newest + 1 if state.newest + 1 < RING else 0
    state.remembered += 1
    for j in range(config.joints):
        state.inputs[state.newest, j] = u[j]


@part
def go_on_with_input(config: EstimatorConfig, state: JointEstimate, periods: int) -> None:
    """Let the last input last for the control periods since the last sample in which there was no new one."""
    for _ in range(state.remembered, periods):
        remember_input(config, state, state.inputs[state.newest])
    state.remembered = 0


@part
def estimate_joints(
    config: EstimatorConfig, state: JointEstimate, stamp_ns: int, q: Array, qd: Array, measured: bool
) -> None:
    """Take a sample in; the estimate of now is `position` and `velocity` of the state.

    Args:
        config: what does not change.
        state: changed.
        stamp_ns: of the sample.
        q, qd: measured; (n,) [rad], [rad/s].
        measured: whether they were, at the stamp; else they are those of the last sample, and the model alone goes on.

    Implements: ours; the filter is Kalman's in steady state, as in R. E. Kalman, 1960.
    """
    dt = (stamp_ns - state.stamp_ns) * 1e-9
    if not goes_on(config, state, stamp_ns):
        start_estimate(config, state, stamp_ns, q, qd)
        return
    periods = max(1, round(dt / config.period))
    go_on_with_input(config, state, periods)
    repeated = True
    for j in range(config.joints):
        repeated = repeated and joint_repeats(state, j, q, qd)
    count_unmeasured(config, state, stamp_ns, periods, q, qd, repeated, measured)
    state.since += periods
    # A sensor slower than the cycle repeats itself for its period; an arm at rest may read the same for any time.
    # Where no joint is measured nothing corrects the estimate, and innovations grow longer.
    seen = state.unmeasured[: config.joints].min() < config.sensor_ticks
    corrects = measured and seen and not (repeated and state.since < config.sensor_ticks)
    if measured and not repeated:
        compare_measurements(config, state, (stamp_ns - state.renewed_ns) * 1e-9, q, qd)
        state.renewed_ns = stamp_ns
    # After a missing sample an innovation has had longer to grow from a wrong velocity or disturbance.
    share = min(1.0, config.sensor_ticks / state.since)
    if corrects:
        state.since = 0
    state.stamp_ns = stamp_ns
    m, step, whole = (
        config.late_ticks,
        transition(config.bandwidth, dt / periods),
        transition(config.bandwidth, config.period),
    )
    for j in range(config.joints):
        x_q, x_v, x_d = state.q[j], state.v[j], state.d[j]
        for ago in range(m + periods - 1, m - 1, -1):
            x_q, x_v = move_on(step, x_q, x_v, x_d, input_of(config, state, ago, j))
        of_q, of_v, trust = q[j] - x_q, qd[j] - x_v, state.trust[j]
        if trust == Trust.BOTH and state.alone != 0:
            trust = Trust.POSITION.value
        if not corrects or is_unmeasured(config, state, j):  # what is known stays
            of_q, of_v = 0.0, 0.0
        else:
            state.mean_q[j] += config.weight * (config.scale[0] * of_q - state.mean_q[j])
            state.mean_v[j] += config.weight * (config.scale[1] * of_v - state.mean_v[j])
            if max(state.mean_q[j] * state.mean_q[j], state.mean_v[j] * state.mean_v[j]) > config.gate:
                state.quick[j] = config.quick_ticks
            elif state.quick[j] > 0:
                state.quick[j] -= 1
        K = config.gain[QUICK if trust == Trust.BOTH and state.quick[j] > 0 else trust]
        x_q, x_v, x_d = (
            x_q + K[0, 0] * of_q + K[0, 1] * of_v,
            x_v + share * K[1, 0] * of_q + K[1, 1] * of_v,
            x_d + share * (share * K[2, 0] * of_q + K[2, 1] * of_v),
        )
        state.q[j], state.v[j], state.d[j] = x_q, x_v, x_d
        for ago in range(m - 1, -1, -1):
            x_q, x_v = move_on(whole, x_q, x_v, x_d, input_of(config, state, ago, j))
        state.position[j], state.velocity[j] = x_q, x_v
    far = False
    for j in range(config.joints):
        unused = is_unmeasured(config, state, j) or state.trust[j] == Trust.POSITION or state.trust[j] == Trust.NEITHER
        far = far or not abs(state.velocity[j] - (0.0 if unused else qd[j])) < FAST
    if far:
        start_estimate(config, state, stamp_ns, q, qd)
        state.d[:] = 0.0


@part
def stay_blind(config: EstimatorConfig, state: JointEstimate) -> None:
    """Let the joints rest where the model has them: the drives hold them."""
    state.v[:] = 0.0
    remember_input(config, state, np.zeros(MAX_JOINTS))


@part
def use_estimate(config: EstimatorConfig, state: JointEstimate, sample: JointSampleLike) -> None:
    """Take a joint state in, and put the estimate of now in its place; where it is off, from a finding on."""
    n = config.joints
    estimate_joints(config, state, sample.stamp_ns, sample.position[:n], sample.velocity[:n], True)
    if config.on != 0 or state.found.reason != Reason.NONE or state.unmeasured.max() >= config.sensor_ticks:
        put_estimate(config, state, sample)


@part
def goes_on(config: EstimatorConfig, state: JointEstimate, stamp_ns: int) -> bool:
    """Return whether a sample follows the one before closely enough to go on with the estimate."""
    dt = (stamp_ns - state.stamp_ns) * 1e-9
    return bool(state.started != 0 and 0.0 < dt <= LONGEST_STEP * config.period)


@part
def replace_sample(config: EstimatorConfig, state: JointEstimate, sample: JointSampleLike) -> bool:
    """Put where the model has the joints in the place of a joint state that cannot be used.

    Returns:
        Whether that is known: not after a pause, nor where its stamp is as wrong as its values.
    """
    n, q, qd = config.joints, state.measured_position.copy(), state.measured_velocity.copy()
    if not goes_on(config, state, sample.stamp_ns):
        state.unmeasured[:n] += 1
        return False
    estimate_joints(config, state, sample.stamp_ns, q[:n], qd[:n], False)
    put_estimate(config, state, sample)
    return True


@part
def put_estimate(config: EstimatorConfig, state: JointEstimate, sample: JointSampleLike) -> None:
    """Put the estimate of now in the place of a joint state.

    Of drives with loops of their own it is the state to which the commands that have been sent lead, q + v / b + what
    is under way: then the law commands what is free of their lag, and the joint does the same that much later.

    Implements: ours: with q' = v, v' = b (u - v) it is (q + v / b)' = u: a predictor after O. J. M. Smith, 1957.
    """
    n = config.joints
    if config.bandwidth > 0.0:
        for j in range(n):
            ahead = state.position[j] + state.velocity[j] / config.bandwidth
            for k in range(1, config.drive_ticks + 1):
                ahead += config.period * input_of(config, state, -k, j)
            sample.position[j], sample.velocity[j] = ahead, state.inputs[state.newest, j]
    else:
        sample.position[:n], sample.velocity[:n] = state.position[:n], state.velocity[:n]


@part
def pad_variances(config: EstimatorConfig, arm: Arm, out: PadVariances) -> None:
    """Write the variances of the pad's twist and of the noise in its change over a period, on pad axes; (6,), (6,).

    Args:
        config: variances of the joint velocities, alike and independent.
        arm: at this joint state.
        out: result.

    Implements: ours: diag(A A^T) sigma^2 with A = R^T J.
    """
    J, R = arm.J, arm.rotation
    for i in range(6):
        total, first = 0.0, 3 if i >= 3 else 0
        axis = i - first
        for j in range(config.joints):
            a = R[0, axis] * J[first, j] + R[1, axis] * J[first + 1, j] + R[2, axis] * J[first + 2, j]
            total += a * a
        out.velocity_variance[i] = total * config.velocity_variance
        out.change_variance[i] = total * config.change_variance
