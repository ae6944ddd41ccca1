"""What the law is evaluated on: samples, gains, slip velocity and load of an arm in this cycle."""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Records
from slip_core.vectors import mat, put_spatial, spatial
from slip_vic_controller.arm.command import Interface
from slip_vic_controller.arm.estimator import pad_variances
from slip_vic_controller.contact.layouts import Observer
from slip_vic_controller.contact.observer import observe
from slip_vic_controller.cycle.agreeing import evaluates_law, hold_with_the_others
from slip_vic_controller.cycle.gains import adapt_slip_gain, gains_now, limit_internal_gain
from slip_vic_controller.cycle.governing import record_pad
from slip_vic_controller.cycle.holding import hold, hold_without_law
from slip_vic_controller.cycle.wrench import own_wrench
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.law.extensions import beyond_dead_band
from slip_vic_controller.law.law import predict_motion
from slip_vic_controller.law.symbols import SlipEstimate
from slip_vic_controller.safety.arbitration import Level
from slip_vic_controller.safety.latency import measure_slip_latency
from slip_vic_controller.safety.reasons import Cause
from slip_vic_controller.safety.validation import fine
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
            level, own = outputs[k].decision.level, history[k * rows : (k + 1) * rows]
            unknown = level == Level.OBSERVED or level == Level.SLOWING
            cause = sense(configs[k], task, states[k], own, inputs[k], outputs[k], unknown)
            outputs[k].decision.cause, failed = cause, failed or cause != Cause.NONE
    if failed:
        for k in range(n):
            if evaluates_law(states[k], outputs[k]):
                _hold_unsensed(configs[k], task, states[k], inputs[k], outputs[k], k == 0)


@part
def _hold_unsensed(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs, lead: bool
) -> None:
    """Hold an arm because it, or another one, could not sense."""
    if outputs.decision.cause != Cause.NONE:
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
    """Find slip, gains and load of an arm in this cycle; return why it could not be, Cause.NONE where it could.

    slip_unknown: there is no slip sample; an observer continues with the model alone.
    """
    law, sample, samples = state.law, state.joint.answers, outputs.samples
    if sample.stamp_ns < law.stamp_ns:
        return Cause.OLD_JOINT_STATE.value
    for k in range(config.law.contacts):
        if state.wrench_modelled != 0:
            samples[k].wrench[:] = state.wrench_of_model[k]
        else:
            samples[k].wrench[:] = state.wrench_inputs[k].values
        samples[k].slip_twist[:] = state.slip_inputs[k].values
        if slip_unknown:
            samples[k].slip_twist[:] = 0.0
    samples[0].slip_twist[:] -= state.tare.slip_bias
    put_spatial(samples[0].wrench, own_wrench(config, state, mat(inputs.arm.rotation)))
    if slip_unknown:
        state.queue.count = 0
    gains_now(state, law.stamp_ns, outputs)
    measure_slip_latency(law.slip_latency, sample.stamp_ns, state.queue)
    outputs.follow_error[:] = 0.0
    if config.cycle.has_observer != 0:
        observer, queue, motion = state.observer, state.queue, outputs.motion
        if not predict_motion(config.law, outputs.gains, inputs.arm, samples, law.slips, observer.twist, motion):
            return Cause.NO_ESTIMATE.value
        if config.estimator.on != 0:
            pad_variances(config.estimator, inputs.arm, motion)
            if config.command.interface != Interface.EFFORT:
                put_twist_now(config, state, inputs, motion.v_ee)
        if not observe(config.observer, observer, history, motion, sample.stamp_ns, queue.samples, queue.count):
            return Cause.NO_ESTIMATE.value
        _put_estimate(observer, outputs.estimate)
        samples[0].slip_twist[:] = observer.twist
        outputs.follow_error[:] = observer.error
    else:
        linear, angular = config.cycle.dead_band_linear, config.cycle.dead_band_angular
        if linear != 0.0 or angular != 0.0:
            v_s = spatial(config.law.contact[0].slip_axes) * spatial(samples[0].slip_twist)
            put_spatial(samples[0].slip_twist, beyond_dead_band(v_s, linear, angular))
        adapt_slip_gain(config, state, outputs)
    if outputs.gains.gains.kappa != 0.0:
        limit_internal_gain(config, state, outputs)
    if config.cycle.gate_shut != 0:
        for k in range(config.law.contacts):
            samples[k].slip_twist[:] = 0.0
    if config.governor.mode != Governing.OFF:
        record_pad(config, task, state, outputs, (sample.stamp_ns - law.stamp_ns) * 1e-9)
    return Cause.NONE.value


@part
def _put_estimate(observer: Observer, out: SlipEstimate) -> None:
    """Write what an observer publishes to a SLIP_ESTIMATE."""
    out.sliding, out.significance = observer.sliding, observer.significance
    for k in range(6):
        out.deviation[k], out.error[k] = math.sqrt(observer.variance[k]), observer.error[k]


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
