"""What the law is evaluated on: samples, gains, slip velocity and load of an arm in this cycle."""

from __future__ import annotations

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.vectors import mat, put_mat, put_spatial, spatial
from slip_vic_controller.arm.command import Interface
from slip_vic_controller.arm.joint_estimate import EstimatorConfig
from slip_vic_controller.contact.layouts import Motion
from slip_vic_controller.contact.observer import observe
from slip_vic_controller.cycle.contact import estimate_contact
from slip_vic_controller.cycle.wrench import own_wrench
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.arm import Arm
from slip_vic_controller.law.bounds import internal_gain_limit
from slip_vic_controller.law.contact import slip_velocity
from slip_vic_controller.law.extensions import judge_compensation, slip_speed
from slip_vic_controller.law.gains import gains_at
from slip_vic_controller.law.law import predict_motion
from slip_vic_controller.law.object import integrate_slips
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ArmCycle, ArmState, ControllerConfig, CycleInputs, CycleOutputs


@part
def gains_now(state: ArmState, stamp_ns: int, outputs: CycleOutputs) -> None:
    """Write gains and payload in effect, with the mass that a tare has found; its inertia grows as much."""
    gains_at(state.law.ramp, stamp_ns, outputs.gains)
    measured = 1.0 + state.tare.mass_share
    outputs.gains.object.mass *= measured
    outputs.gains.object.inertia[:] *= measured


@part
def limit_internal_gain(config: ControllerConfig, state: ArmState, outputs: CycleOutputs) -> None:
    """Lower kappa to what the measured delay from a wrench to its answer, and the drives' lag, allow."""
    gains, late_ns = outputs.gains.gains, 0
    for k in range(config.law.contacts):
        late_ns = max(late_ns, state.joint.answers.stamp_ns - state.wrench_inputs[k].stamp_ns)
    late_s = config.drive_lag_s + config.kappa_late_s
    delay_s = late_s + 1e-9 * (config.period_ns + state.latency.most_ns + late_ns)
    least = min(gains.M_D[0], gains.M_D[1], gains.M_D[2])
    most = internal_gain_limit(least, config.pad_stiffness, delay_s)
    gains.kappa = min(gains.kappa, config.kappa_share * most)


@part
def sense(c: ArmCycle, history: Array) -> int:
    """Find slip, gains and load of an arm in this cycle; return why it could not be, Reason.NONE where it could."""
    config, state, inputs, outputs = c.config, c.state, c.inputs, c.outputs
    law, sample, samples, queue = state.law, state.joint.answers, outputs.samples, state.queue
    dt = max(sample.stamp_ns - law.stamp_ns, 0) * 1e-9
    unknown = state.conditions[Reason.SLIP_PREDICTED].since_ns != NEVER
    unknown = unknown or state.conditions[Reason.SLIP_SENSOR].since_ns != NEVER
    for k in range(config.law.contacts):
        samples[k].wrench[:] = state.wrench_inputs[k].values
        if state.wrench_modelled != 0:
            samples[k].wrench[:] = state.wrench_of_model[k]
        if not unknown:
            samples[k].slip_twist[:] = state.slip_inputs[k].values
    samples[0].slip_twist[:] -= state.tare.slip.bias[:6]
    put_spatial(samples[0].wrench, own_wrench(config, state, mat(inputs.arm.rotation)))
    if unknown:
        queue.count = 0  # an observer continues with the model alone
    gains_now(state, law.stamp_ns, outputs)
    observer, motion, observes = state.observer, outputs.motion, config.has_observer != 0
    put_mat(motion.rotation, mat(inputs.arm.rotation))
    put_spatial(motion.v_ee, spatial(inputs.arm.twist))
    if observes:
        if not predict_motion(config.law, outputs.gains, inputs.arm, samples, law.slips, observer.twist, motion):
            return Reason.NO_ESTIMATE.value
        if config.estimator.on != 0:
            pad_variances(config.estimator, inputs.arm, motion)
    if config.estimator.on != 0 and config.command.interface != Interface.EFFORT:
        put_twist_now(config, state, inputs, motion.v_ee)
    if observes:
        if not observe(config.observer, observer, history, motion, sample.stamp_ns, queue.samples, queue.count):
            return Reason.NO_ESTIMATE.value
        estimate = outputs.estimate
        estimate.sliding, estimate.significance = observer.sliding, observer.significance
        estimate.deviation[:], estimate.error[:] = np.sqrt(observer.variance), observer.error
        outputs.follow_error[:] = observer.error
    if outputs.gains.gains.kappa != 0.0:
        limit_internal_gain(config, state, outputs)
    if config.governor.mode != Governing.OFF or config.conditions.slip_needed != 0:
        estimate_contact(config, c.task, state, outputs, unknown, dt)
    _slip_for_law(c, dt)
    return Reason.NONE.value


@part
def pad_variances(config: EstimatorConfig, arm: Arm, out: Motion) -> None:
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


@part
def _slip_for_law(c: ArmCycle, dt: float) -> None:
    """Write the slip velocity that the law answers, and let the object move on the pad by the one of now.

    It is the estimated one, or the newest sample; with drives that answer late the one to which the commands under way
    lead; and zero where the law takes the object as held.
    """
    config, state, outputs = c.config, c.state, c.outputs
    law, samples, contact = state.law, outputs.samples, state.pad.contact
    if config.gate_shut != 0:
        for k in range(config.law.contacts):
            samples[k].slip_twist[:] = 0.0
    elif config.has_observer != 0:
        samples[0].slip_twist[:] = state.observer.twist
    integrate_slips(config.law, samples, law.slips, dt, outputs.slips)
    if config.law.yields > 0.0:
        v_s = slip_velocity(config.law.contact[0], samples[0])
        judge_compensation(law.given_up, outputs.gains.gains, v_s, state.observed.fall_speed, dt)
    if config.slip_ahead_s > 0.0:
        _foresee_slip(config, state, c.inputs, outputs)
    contact.v_s[:] = samples[0].slip_twist


@part
def _foresee_slip(config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs) -> None:
    """Replace the slip velocity by the one to which the commands under way lead, as the joints are, see `foresee`.

    Until then the pad's twist changes by what is known, and the object's as the wrench accelerates it now. Else the law
    would answer for as long as drives take to what it has answered already. No larger than now: where the object
    nearly holds, its acceleration changes with the pad's, and what is predicted is none.

    Implements: ours: v_s + J (qd_commanded - qd) - t (G^T a_o + Phi2), a predictor after O. J. M. Smith, 1957.
    """
    contact, sample, now = config.law.contact[0], outputs.samples[0], np.zeros(6)
    v_s = slip_velocity(contact, sample)
    if v_s.dot(v_s) == 0.0:
        return
    put_twist_now(config, state, inputs, now)
    follow = spatial(outputs.motion.follow)
    change = spatial(inputs.arm.twist) - spatial(now) - config.slip_ahead_s * follow
    error = config.slip_ahead_s * spatial(outputs.follow_error)
    ahead = v_s + spatial(contact.slip_axes) * (mat(inputs.arm.rotation).T() @ change - error)
    gains = outputs.gains.gains
    most, speed = slip_speed(gains, v_s), slip_speed(gains, ahead)
    put_spatial(sample.slip_twist, (most / speed) * ahead if speed > most else ahead)


@part
def put_twist_now(config: ControllerConfig, state: ArmState, inputs: CycleInputs, twist: Array) -> None:
    """Write the pad's twist of now (6,) {w}: the law's is that of the commands under way.

    So is its Jacobian: what that changes on the way there is taken off.
    """
    put_twist_of_joints(config, state, inputs, twist)
    for i in range(6):
        twist[i] -= config.drive_lag_s * inputs.arm.jdot_qd[i]


@part
def put_twist_of_joints(config: ControllerConfig, state: ArmState, inputs: CycleInputs, twist: Array) -> None:
    """Write the twist (6,) {w} that the joints' velocities of now give the pad: zero where none moves."""
    for i in range(6):
        twist[i] = 0.0
        for j in range(config.law.joints):
            twist[i] += inputs.arm.J[i, j] * state.estimate.velocity[j]
