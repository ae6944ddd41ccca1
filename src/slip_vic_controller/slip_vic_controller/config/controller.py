"""From parameters and arm to the record of the control cycle: the one place where parameters become its numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slip_core.arrays import Array, inertia_from_six, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.matrices import product
from slip_core.records import copy_fields, new, record
from slip_core.stamps import seconds_to_ns
from slip_vic_controller.arm.command import Interface
from slip_vic_controller.arm.estimator import BLIND_S, MEAN_S
from slip_vic_controller.arm.joint_estimate import ESTIMATOR_CONFIG
from slip_vic_controller.config.joints import DEVIATIONS, estimator_config
from slip_vic_controller.config.observer import TUNING, observer_config, witnesses
from slip_vic_controller.contact.friction_estimate import Friction
from slip_vic_controller.contact.layouts import OBSERVER_CONFIG
from slip_vic_controller.contact.wrench_evidence import Handover
from slip_vic_controller.governor.grip import SINKS_S
from slip_vic_controller.governor.layouts import GovernorConfig
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.interfaces import fill_wrench_sensor
from slip_vic_controller.law.bounds import DRIVE_SHARE
from slip_vic_controller.law.config import LAW_CONFIG, make_law_config
from slip_vic_controller.law.contact import fill_contacts
from slip_vic_controller.law.gains import LAW_GAINS, UNKNOWN_LAG, gain_report
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.paths import PATH, make_path
from slip_vic_controller.robot import Robot
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.safety.effort_limiter import LONGEST_STEP_S
from slip_vic_controller.safety.hold import DELAY, LEAST_LOAD, HoldConfig
from slip_vic_controller.safety.motion import FALLS_WITHIN_S
from slip_vic_controller.safety.validation import ACCEPT_AFTER, CLOCK_JUMP_S, JUMP, SLACK
from slip_vic_controller.sizes import ROOM
from slip_vic_controller.state import CONFIG, ControllerConfig

PATH_MARGIN, GIVEN_UP, KEPT = 0.97, 0.985, 0.95
"""Shares of a load: in the backward pass; of that at which it slipped, where nothing less stops; kept of it."""
LEAST_SHARE, TRUST = 0.02, 0.5
"""Least friction that is accepted, of the configured one; least load of the model, of the measured one."""
PATH_LENGTH_M, PATH_FLOOR_M_S = 0.1, 0.05
"""Time-optimal: length that makes turning a way, and the speed at which the path continues where it turns back."""
UNTOLD_S = 0.003
"""By which efforts may be later than configured, for the bound on kappa [s]: with 2 ms two arms swing at kappa 0.8."""
SHARED_RESERVE = 0.3
"""Share of what the weight, and `governor.reserve`, leave that the path of several arms does not use: one pad may bear
less than the others, the arms press on each other, and a camera sees what slips too late."""
CONFIRMED = 2
"""Slip samples in a row that are believed where the observer finds slip too, on an arm whose joints are estimated: it
finds some there that are none, and one sample may be an outlier."""
QUIET_S = 0.05
"""Without slip for so long, it holds again."""
STOPS_WITHIN = 2.0
"""How much longer than a path that is slowed down one may need that friction has to brake."""
QUANTISED_REPEATS = 5
"""How many times as long a sensor with a quantum may repeat a reading before it counts as frozen."""


def make_config(params: ControllerParams, robot: Robot, *, lockstep: bool, arms: int = 1) -> Array:
    """Return the CONFIG of an arm's controller.

    Args:
        params: checked parameters.
        robot: the arm.
        lockstep: whether a clock or position that jumps is taken at once, since the bridge waits for the answer.
        arms: how many hold the object.

    Raises:
        InputError: parameters and arm do not fit.
    """
    buffer = new(CONFIG)
    config = record(buffer, CONFIG)
    _copy(config, "law", make_law_config(params, robot.effort_limit), LAW_CONFIG)
    _copy(config, "path", make_path(params.trajectory), PATH)
    if params.trajectory.of == "object":
        o_R_p = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4])
        config.path.carries, config.path.lever[:] = 1, product(o_R_p.T, np.array(params.contacts.position[:3]))
    _copy(config, "gains", gain_report(params).gains, LAW_GAINS)
    config.hold.carriers = max(arms, params.contacts.count)
    for part in (config.command, config.hold, config.tare):
        part.joints = len(robot.joint_names)
    use_noise(config, params, robot.effort_limit)
    copy_fields(config.tare, params.tare, params.object)
    config.tare.slip_linear, config.tare.slip_angular = params.tare.slip
    config.tare.force, config.tare.torque = params.tare.wrench
    copy_fields(config.grip, params.grip)
    config.grip.follow, config.grip.preview_s = int(params.grip.control == "follow"), params.grip.lag_s + SINKS_S
    _fill_cycle(config, params, len(robot.joint_names))
    _fill_inputs(config, params, robot, lockstep=lockstep)
    _fill_conditions(config, params)
    _fill_limits(config, params, robot)
    _fill_hold(config.hold, params)
    fill_wrench_sensor(config.wrench_sensor, params, robot)
    buffer.setflags(write=False)
    return buffer


def renew_config(config: ControllerConfig, params: ControllerParams) -> None:
    """Take changed parameters into a CONFIG: what HOLD holds, and with which stiffness. Gains and payload of the law
    ramp, see `Ramp`; a change in HOLD is bounded by the effort limiter."""
    fill_contacts(params.contacts, config.law.contact)
    config.gains = gain_report(params).gains.view(LAW_GAINS)[0]
    _fill_hold(config.hold, params)


def use_noise(config: ControllerConfig, params: ControllerParams, effort_limit: Array) -> None:
    """Use noise of the sensors in a CONFIG: what observer, estimator and governor take of it.

    Args:
        config: changed.
        params: with that noise.
        effort_limit: (n,) [N m].
    """
    if params.slip_estimator == "observer":
        _copy(config, "observer", observer_config(params), OBSERVER_CONFIG)
    _copy(config, "estimator", estimator_config(params, effort_limit), ESTIMATOR_CONFIG)
    _fill_governor(config.governor, params)


def governed_stream(params: ControllerParams) -> bool:
    """Return whether references come by topic and are governed."""
    return params.trajectory.kind == "topic" and params.governor.mode != "off"


def _copy(config: Any, name: str, buffer: Array, layout: np.dtype[np.void]) -> None:
    config[name] = buffer.view(layout)[0]


def _fill_cycle(cycle: ControllerConfig, params: ControllerParams, joints: int) -> None:
    posture = params.nullspace.posture
    if posture and len(posture) != joints:
        raise InputError("parameter nullspace.posture", got=f"{len(posture)} values", expected=f"{joints} or none")
    copy_fields(cycle, params, params.gains, params.slip_sensor, params.nullspace, params.safety.fallback)
    cycle.period_ns, cycle.start_s = seconds_to_ns(params.control_period_s), params.trajectory.start_s
    cycle.posture_given = int(bool(posture))
    cycle.has_observer = int(params.slip_estimator == "observer")
    cycle.follows_stream, cycle.follows_goals = int(governed_stream(params)), int(params.trajectory.kind == "goal")
    # A flag reports no speed; and below a governor, which prevents slip, compensation answers noise and delays.
    cycle.gate_shut = int(params.slip_input == "flag" or params.governor.mode != "off")
    cycle.handover = Handover[params.handover.upper()]
    cycle.models_wrench = int(params.wrench.source == "none")
    cycle.leaves_gravity = int(params.effort.gravity == "robot_compensates")
    if params.foresees_slip and cycle.gate_shut == 0:
        cycle.slip_ahead_s = (1.0 - UNKNOWN_LAG) * params.drive_lag_s
    # Else the arm does what is commanded, at once.
    cycle.kappa_share, cycle.kappa_late_s = (DRIVE_SHARE, UNTOLD_S) if params.estimates_joints else (1.0, 0.0)


def _fill_inputs(config: ControllerConfig, params: ControllerParams, robot: Robot, *, lockstep: bool) -> None:
    inputs, n, joint = params.safety.inputs, len(robot.joint_names), config.joint
    copy_fields(joint, inputs)
    joint.lower[:n], joint.upper[:n] = robot.position_lower - SLACK, robot.position_upper + SLACK
    joint.fastest = SLACK / params.control_period_s
    joint.jump, joint.clock_jump_ns = JUMP, seconds_to_ns(CLOCK_JUMP_S)
    joint.accept_after = 1 if lockstep else ACCEPT_AFTER
    joint.still = params.joint_sensor.quantum_position / inputs.frozen_s
    wrench, slip = config.wrench, config.slip
    for limits in (wrench, slip):
        copy_fields(limits, inputs)
        limits.future_ns = seconds_to_ns(inputs.age_s)
    (wrench.linear, wrench.angular), (slip.linear, slip.angular) = inputs.wrench, inputs.slip
    slip.age_ns = seconds_to_ns(inputs.slip_age_s)
    slip.zero_is_normal = 1
    if params.slip_sensor.quantum_linear > 0.0:  # a slip that changes by less than a quantum reads the same
        slip.frozen_ns *= QUANTISED_REPEATS
    if params.slip_input == "flag":  # it may stay up, and no speed of it can contradict the wrench
        slip.frozen_ns = np.iinfo(np.int64).max


def _fill_conditions(config: ControllerConfig, params: ControllerParams) -> None:
    safety, conditions = params.safety, config.conditions
    copy_fields(conditions, safety, safety.inputs)
    for reason in Reason:
        conditions.lasts_ns[reason] = seconds_to_ns(reason.lasts_s) + 1 if reason.lasts_s else 0  # for longer
    observer_s = safety.fallback.observer_s if params.slip_estimator == "observer" else 0.0
    conditions.lasts_ns[Reason.SLIP_SLOWS] = seconds_to_ns(observer_s)
    conditions.slow_down_ns = seconds_to_ns(STOPS_WITHIN * safety.fallback.slow_down_s)
    # So that the arm rests by the time at which the model no longer tells where it is.
    unseen_s = min(safety.inputs.bridge_s + safety.fallback.slow_down_s, BLIND_S - safety.inputs.age_s)
    conditions.unseen_ns = seconds_to_ns(unseen_s)
    conditions.gap_ns = seconds_to_ns(safety.inputs.age_s)
    conditions.slip_needed = int(params.controller != "classical")
    copy_fields(config.drop, safety.load, safety.limits)
    config.drop.memory_s = FALLS_WITHIN_S
    if any(params.gravity):  # without gravity nothing falls
        config.drop.down[:] = np.array(params.gravity) / math.hypot(*params.gravity)


def _fill_limits(config: ControllerConfig, params: ControllerParams, robot: Robot) -> None:
    n, limits = len(robot.joint_names), config.command
    copy_fields(limits, params.safety.limits)
    limits.interface = Interface[params.command.interface.upper()]
    limits.effort[:n], limits.velocity[:n] = robot.effort_limit, robot.velocity_limit
    limits.acceleration[:n] = params.command.acceleration_limit
    limits.lower[:n], limits.upper[:n] = robot.position_lower, robot.position_upper
    limits.period_ns = config.period_ns
    limits.longest_step_ns = max(seconds_to_ns(LONGEST_STEP_S), config.period_ns)  # a control period is no pause
    limits.restart_after_ns = seconds_to_ns(params.safety.inputs.age_s)


def _fill_hold(hold: HoldConfig, params: ControllerParams) -> None:
    stiffness, share = params.safety.hold_stiffness, 1.0 / hold.carriers
    frequency = max(math.sqrt(stiffness), 1.0)
    slower = min(1.0, 0.5 * DELAY / (frequency * params.control_period_s))  # the same loop in slow motion
    hold.stiffness, hold.damping = slower * slower * stiffness, slower * 2.0 * math.sqrt(stiffness)
    hold.least_load = LEAST_LOAD if share == 1.0 else 0.0  # several arms also feel what they press on each other
    hold.mass = share * params.object.mass
    hold.inertia[:] = share * inertia_from_six(params.object.inertia, "parameter object.inertia")
    hold.weight[:] = hold.mass * np.array(params.gravity)


def _fill_governor(governor: GovernorConfig, params: ControllerParams) -> None:
    given, path, sensor, limits = params.governor, params.trajectory, params.slip_sensor, params.safety.limits
    copy_fields(governor, given)
    governor.mode = Governing[given.mode.upper()] if path.kind != "hold" else Governing.OFF
    governor.path_margin, governor.given_up = PATH_MARGIN, GIVEN_UP
    # Unknown friction is found by asking for more than is known to hold: all of it has to be asked.
    shared = SHARED_RESERVE if params.contacts.count > 1 else 0.0
    governor.reserve = given.reserve + shared * (1.0 - given.reserve) if given.friction != "unknown" else 0.0
    governor.radius, governor.slip_axes[:] = given.torsional_radius, params.contacts.slip_axes[:6]
    governor.weights[:3], governor.weights[3:] = governor.slip_axes[:3], governor.slip_axes[3:] / governor.radius
    governor.gravity[:] = params.gravity
    governor.duration, governor.length, governor.floor = path.duration_s, PATH_LENGTH_M, PATH_FLOOR_M_S
    governor.most_speed, governor.most_turning = limits.speed_linear, limits.speed_angular
    governor.most_grip = params.grip.cap / params.grip.nominal_force if params.grip.control == "follow" else 1.0
    governor.window = min(max(1, round(given.window_s / params.control_period_s)), ROOM)
    # Several arms without a common path pull the object apart, and no way is left to brake in.
    governor.led = int(len(params.contacts.position) == 3)
    estimate = governor.friction
    copy_fields(estimate, given)
    estimate.friction, estimate.configured, estimate.kept = Friction[given.friction.upper()], given.friction_limit, KEPT
    estimate.least, estimate.trust = LEAST_SHARE * given.friction_limit, TRUST
    noise = math.hypot(math.sqrt(2.0) * sensor.noise_linear, given.torsional_radius * sensor.noise_angular)
    estimate.quantum = math.inf if params.slip_input == "flag" else sensor.quantum_linear
    estimate.threshold = max(TUNING.least_slip[0], DEVIATIONS * noise, sensor.quantum_linear)
    estimate.noise_ns = seconds_to_ns(MEAN_S) if params.tare.duration_s > 0.0 else 0
    estimate.witnesses = witnesses(params)
    estimate.confirmed = min(CONFIRMED, estimate.witnesses) if params.estimates_joints else 1
    estimate.quiet_ns = seconds_to_ns(QUIET_S)
    estimate.sensor_delay_ns = seconds_to_ns(sensor.latency_s + sensor.period_s)
