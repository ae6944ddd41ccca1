"""What the law is evaluated on: samples, gains, slip velocity and load of an arm in this cycle."""

from __future__ import annotations

import math

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Records
from slip_core.vectors import mat, put_mat, put_spatial, spatial
from slip_vic_controller.arm.command import Interface
from slip_vic_controller.arm.estimator import pad_variances
from slip_vic_controller.contact.layouts import Observer
from slip_vic_controller.contact.observer import observe
from slip_vic_controller.cycle.agreeing import evaluates_law, hold_with_the_others
from slip_vic_controller.cycle.contact import estimate_contact
from slip_vic_controller.cycle.gains import adapt_slip_gain, gains_now, limit_internal_gain
from slip_vic_controller.cycle.holding import hold, hold_without_law
from slip_vic_controller.cycle.wrench import own_wrench
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.contact import integrate_slips, slip_velocity
from slip_vic_controller.law.extensions import beyond_dead_band, judge_compensation, slip_speed
from slip_vic_controller.law.law import predict_motion
from slip_vic_controller.law.symbols import SlipEstimate
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.safety.latency import measure_slip_latency
from slip_vic_controller.safety.validation import fine
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ArmState, ControllerConfig, CycleInputs, CycleOutputs, TaskState


@part
def sense_all(
    configs: Records[ControllerConfig],
    task: TaskState,
    states: Records[ArmState],
    history: Array,
    inputs: Records[CycleInputs],
    outputs: Records[CycleOutputs],
) -> None:
    """Let every arm at work sense; where one cannot, it and the others hold."""
    n, failed = len(states), False
    rows = history.shape[0] // n
    for k in range(n):
        if evaluates_law(states[k], outputs[k]):
            own = history[k * rows : (k + 1) * rows]
            unknown = states[k].conditions[Reason.SLIP_PREDICTED].since_ns != NEVER
            cause = sense(configs[k], task, states[k], own, inputs[k], outputs[k], unknown)
            outputs[k].decision.cause, failed = cause, failed or cause != Reason.NONE
    if failed:
        for k in range(n):
            if evaluates_law(states[k], outputs[k]):
                _hold_unsensed(configs[k], task, states[k], inputs[k], outputs[k], k == 0)


@part
def _hold_unsensed(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, lead: bool
) -> None:
    """Hold an arm because it, or another one, could not sense."""
    if outputs.decision.cause != Reason.NONE:
        hold_without_law(config, task, state, inputs, outputs, outputs.decision.cause)
    else:
        hold_with_the_others(config, state, inputs, outputs)
        hold(config, task, state, inputs, outputs, fine(outputs.health.wrench), lead)


@part
def sense(
    config: ControllerConfig,
    task: TaskState,
    state: ArmState,
    history: Array,
    inputs: CycleInputs,
    outputs: CycleOutputs,
    slip_unknown: bool,
) -> int:
    """Find slip, gains and load of an arm in this cycle; return why it could not be, Reason.NONE where it could.

    slip_unknown: there is no slip sample; an observer continues with the model alone.
    """
    law, sample, samples = state.law, state.joint.answers, outputs.samples
    dt = max(sample.stamp_ns - law.stamp_ns, 0) * 1e-9
    for k in range(config.law.contacts):
        if state.wrench_modelled != 0:
            samples[k].wrench[:] = state.wrench_of_model[k]
        else:
            samples[k].wrench[:] = state.wrench_inputs[k].values
        samples[k].slip_twist[:] = state.slip_inputs[k].values
        if slip_unknown:
            samples[k].slip_twist[:] = 0.0
    samples[0].slip_twist[:] -= state.tare.slip.bias[:6]
    put_spatial(samples[0].wrench, own_wrench(config, state, mat(inputs.arm.rotation)))
    if slip_unknown:
        state.queue.count = 0
    gains_now(state, law.stamp_ns, outputs)
    measure_slip_latency(law.slip_latency, sample.stamp_ns, state.queue)
    outputs.follow_error[:] = 0.0
    observer, queue, motion = state.observer, state.queue, outputs.motion
    put_mat(motion.rotation, mat(inputs.arm.rotation))
    put_spatial(motion.v_ee, spatial(inputs.arm.twist))
    if config.cycle.has_observer != 0:
        if not predict_motion(config.law, outputs.gains, inputs.arm, samples, law.slips, observer.twist, motion):
            return Reason.NO_ESTIMATE.value
        if config.estimator.on != 0:
            pad_variances(config.estimator, inputs.arm, motion)
    if config.estimator.on != 0 and config.command.interface != Interface.EFFORT:
        put_twist_now(config, state, inputs, motion.v_ee)
    if config.cycle.has_observer != 0:
        if not observe(config.observer, observer, history, motion, sample.stamp_ns, queue.samples, queue.count):
            return Reason.NO_ESTIMATE.value
        _put_estimate(observer, outputs.estimate)
        outputs.follow_error[:] = observer.error
    else:
        adapt_slip_gain(config, state, outputs)
    if outputs.gains.gains.kappa != 0.0:
        limit_internal_gain(config, state, outputs)
    if config.governor.mode != Governing.OFF or config.conditions.slip_needed != 0:
        estimate_contact(config, task, state, outputs, slip_unknown, dt)
    _slip_for_law(config, state, inputs, outputs, dt)
    return Reason.NONE.value


@part
def _slip_for_law(
    config: ControllerConfig, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, dt: float
) -> None:
    """Write the slip velocity that the law answers, and let the object move on the pad by the one of now.

    It is the estimated one, or the newest sample beyond the dead band; with drives that answer late the one to which
    the commands under way lead; and zero where the law takes the object as held.
    """
    law, samples, contact = state.law, outputs.samples, state.pad.contact
    if config.cycle.gate_shut != 0:
        for k in range(config.law.contacts):
            samples[k].slip_twist[:] = 0.0
    elif config.cycle.has_observer != 0:
        samples[0].slip_twist[:] = state.observer.twist
    elif config.cycle.dead_band_linear != 0.0 or config.cycle.dead_band_angular != 0.0:
        v_s = spatial(config.law.contact[0].slip_axes) * spatial(samples[0].slip_twist)
        v_s = beyond_dead_band(v_s, config.cycle.dead_band_linear, config.cycle.dead_band_angular)
        put_spatial(samples[0].slip_twist, v_s)
    integrate_slips(config.law, samples, law.slips, dt, outputs.slips)
    if config.law.yields > 0.0:
        v_s = slip_velocity(config.law.contact[0], samples[0])
        judge_compensation(law.given_up, outputs.gains.gains, v_s, state.observed.fall_speed, dt)
    if config.cycle.slip_ahead_s > 0.0:
        _foresee_slip(config, state, inputs, outputs)
    contact.v_s[:] = samples[0].slip_twist


@part
def _put_estimate(observer: Observer, out: SlipEstimate) -> None:
    """Write what an observer publishes to a SLIP_ESTIMATE."""
    out.sliding, out.significance = observer.sliding, observer.significance
    for k in range(6):
        out.deviation[k], out.error[k] = math.sqrt(observer.variance[k]), observer.error[k]


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
    change = spatial(inputs.arm.twist) - spatial(now) - config.cycle.slip_ahead_s * follow
    error = config.cycle.slip_ahead_s * spatial(outputs.follow_error)
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
        twist[i] -= config.cycle.drive_lag_s * inputs.arm.jdot_qd[i]


@part
def put_twist_of_joints(config: ControllerConfig, state: ArmState, inputs: CycleInputs, twist: Array) -> None:
    """Write the twist (6,) {w} that the joints' velocities of now give the pad: zero where none moves."""
    for i in range(6):
        twist[i] = 0.0
        for j in range(config.law.joints):
            twist[i] += inputs.arm.J[i, j] * state.estimate.velocity[j]
