"""From parameters and arm to the record of the control cycle: the one place where parameters become its numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from slip_core.arrays import Array, inertia_from_six, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.matrices import product
from slip_core.records import new, record
from slip_core.stamps import seconds_to_ns
from slip_vic_controller.arm.command import LEAD, Interface
from slip_vic_controller.arm.config import estimator_config
from slip_vic_controller.arm.joint_estimate import ESTIMATOR_CONFIG
from slip_vic_controller.arm.plausibility import BLIND_S
from slip_vic_controller.arm.robot import Robot
from slip_vic_controller.arm.tare import MOST_VELOCITY_BIAS, STILL, TareConfig
from slip_vic_controller.contact.config import observer_config, witnesses
from slip_vic_controller.contact.friction_estimate import Friction
from slip_vic_controller.contact.layouts import OBSERVER_CONFIG
from slip_vic_controller.governor.grip import GripConfig
from slip_vic_controller.governor.layouts import MAX_WINDOW, GovernorConfig
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.interfaces import fill_wrench_sensor
from slip_vic_controller.law.bounds import DRIVE_SHARE, INTERNAL_BOUND, ROUNDING, internal_gain_limit
from slip_vic_controller.law.config import LAW_CONFIG, make_law_config
from slip_vic_controller.law.contact import fill_contacts
from slip_vic_controller.law.gains import LAW_GAINS, UNKNOWN_LAG, gain_report, make_law_gains
from slip_vic_controller.params.arm_params import TareParams
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.params.interface_params import GripParams
from slip_vic_controller.params.safety_params import InputParams, SafetyParams, WatchParams
from slip_vic_controller.path.goals import GoalsConfig
from slip_vic_controller.path.paths import PATH, make_path
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.safety.drop_detection import FALLS_WITHIN_S, DropDetectionConfig
from slip_vic_controller.safety.effort_limiter import LONGEST_STEP_S, RESTART_AFTER_S
from slip_vic_controller.safety.hold import LEAST_LOAD, LOAD_S, HoldConfig
from slip_vic_controller.safety.limit_avoidance import BRAKE_SHARE, BRAKED_FROM, TRIP_SHARE
from slip_vic_controller.safety.validation import (
    ACCEPT_AFTER,
    CLOCK_JUMP_S,
    FASTEST,
    FUTURE_S,
    JUMP,
    SLACK,
    VectorLimits,
)
from slip_vic_controller.state import CONFIG, ControllerConfig, CycleConfig

PATH_MARGIN, GIVEN_UP, KEPT = 0.97, 0.985, 0.95
"""Shares of a load: in the backward pass; of that at which it slipped, where nothing less stops; kept of it."""
LEAST_SHARE, TRUST = 0.02, 0.5
"""Least friction that is accepted, of the configured one; least load of the model, of the measured one."""
PATH_LENGTH_M, PATH_FLOOR_M_S = 0.1, 0.05
"""Time-optimal: length that makes turning a way, and the speed at which the path continues where it turns back."""
UNTOLD_S = 0.003
"""By which efforts may be later than told, for the bound on kappa [s]: with 2 ms two arms swing at kappa 0.8."""
SHARED_RESERVE = 0.3
"""Share of what the weight, and `governor.reserve`, leave that the path of several arms does not use: one pad may bear
less than the others, the arms press on each other, and a camera sees what slips too late."""
SAMPLES_AHEAD = 16
"""Samples of a governed stream in the time that it is looked ahead; closer ones are thinned."""
NOISE_S = 0.01
"""Where sensors have noise that a tare measures: the load that slipped is the mean of so long before and after, and
what the observer finds for a shorter time is an outlier of the slip sensor."""
LEAST_SLIP_M_S, NOISE_DEVIATIONS = 5e-5, 6.0
"""What counts as slip: a speed, and so many standard deviations of a sample."""
NEVER_FROZEN_NS = 2**62
CONFIRMED = 2
"""Slip samples in a row that are believed where the observer finds slip too, on an arm whose joints are estimated: it
finds some there that are none, and one sample may be an outlier."""
QUIET_S = 0.05
"""Without slip for so long, it holds again."""
HOLD_PERIOD_S = 0.01
"""Longest control period at which HOLD has its configured gains; beyond it is the same loop in slow motion [s]."""
STOPS_WITHIN = 2.0
"""How much longer than a path that is slowed down one may need that friction has to brake."""
UNSEEN_SHARE = 0.9
"""Share of the time for which the model tells where an arm is after which it holds, so that it rests in the end."""
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
    _check_internal_gain(params)
    gains = make_law_gains(params, gain_report(params).used)
    _copy(config, "gains", gains, config.gains.dtype)
    _fill_observer(config, params)
    _copy(config, "estimator", estimator_config(params, robot.effort_limit), ESTIMATOR_CONFIG)
    _fill_tare(config.tare, params.tare, params.object.mass, len(robot.joint_names))
    safety = params.safety
    _fill_cycle(config.cycle, params, len(robot.joint_names))
    _fill_inputs(config, params, robot, lockstep=lockstep)
    _fill_modes(config, params)
    _fill_limits(config, safety, robot, params.control_period_s)
    _fill_command(config, params, robot)
    _fill_drop(config.drop, params)
    config.hold.joints, config.hold.carriers = len(robot.joint_names), max(arms, params.contacts.count)
    _fill_hold(config.hold, params)
    _fill_governor(config.governor, params)
    config.stream.on = int(governed_stream(params))
    config.stream.preview_s = params.governor.preview_s
    config.stream.spacing_s = params.governor.preview_s / SAMPLES_AHEAD
    _fill_goals(config.goals, params)
    _fill_grip(config.grip, params.grip)
    fill_wrench_sensor(config.wrench_sensor, params, robot)
    buffer.setflags(write=False)
    return buffer


def renew_config(config: ControllerConfig, params: ControllerParams) -> None:
    """Take changed parameters into a CONFIG: what HOLD holds, and with which stiffness. Gains and payload of the law
    ramp, see `Ramp`; a change in HOLD is bounded by the effort limiter."""
    fill_contacts(params.contacts, config.law.contact)
    config.gains = make_law_gains(params, gain_report(params).used).view(LAW_GAINS)[0]
    _fill_hold(config.hold, params)


def use_noise(config: ControllerConfig, params: ControllerParams, effort_limit: Array) -> None:
    """Use other noise of the sensors in a CONFIG: what observer, estimator and governor take of it.

    Args:
        config: changed.
        params: with that noise.
        effort_limit: (n,) [N m].
    """
    _fill_observer(config, params)
    _copy(config, "estimator", estimator_config(params, effort_limit), ESTIMATOR_CONFIG)
    _fill_governor(config.governor, params)


def _fill_tare(tare: TareConfig, given: TareParams, mass: float, joints: int) -> None:
    tare.duration_ns, tare.joints = seconds_to_ns(given.duration_s), joints
    tare.slip_linear, tare.slip_angular = given.slip_linear, given.slip_angular
    tare.force, tare.torque, tare.mass_share = given.force, given.torque, given.mass_share
    tare.mass = mass
    tare.velocity, tare.still = MOST_VELOCITY_BIAS, STILL


def _check_internal_gain(params: ControllerParams) -> None:
    """Refuse a kappa that is too large for the control period alone.

    Raises:
        InputError: it is.
    """
    gains = params.gains
    most = internal_gain_limit(min(gains.inertia[:3]), gains.pad_stiffness, params.control_period_s)
    if len(params.contacts.position) > 3 and gains.kappa > (1.0 + ROUNDING) * most:
        raise InputError(
            "parameter gains.kappa",
            got=gains.kappa,
            expected=f"at most {most:.6g}: kappa gains.pad_stiffness period^2 / gains.inertia below {INTERNAL_BOUND}",
        )


def governed_stream(params: ControllerParams) -> bool:
    """Return whether references come by topic and are governed."""
    return params.trajectory.kind == "topic" and params.governor.mode != "off"


def gate_shut(params: ControllerParams) -> bool:
    """Return whether the law takes the object as held, whatever the slip sensor reports.

    A flag reports no speed; and below a governor, which prevents slip, compensation answers what noise and delays make
    of the slip velocity.
    """
    return params.slip_input == "flag" or params.governor.mode != "off"


def _copy(config: Any, name: str, buffer: Array, layout: np.dtype[np.void]) -> None:
    config[name] = buffer.view(layout)[0]


def _fill_cycle(cycle: CycleConfig, params: ControllerParams, joints: int) -> None:
    safety, posture, dead_band = params.safety, params.nullspace.posture, params.measured
    if posture and len(posture) != joints:
        raise InputError("parameter nullspace.posture", got=f"{len(posture)} values", expected=f"{joints} or none")
    cycle.period_ns = round(1e9 * params.control_period_s)
    cycle.late_ns = seconds_to_ns(safety.inputs.joint.late_s)
    cycle.slow_down_s = safety.fallback.slow_down_s
    cycle.start_s = params.trajectory.start_s
    cycle.posture_given = int(bool(posture))
    cycle.posture[: len(posture)] = posture
    cycle.has_observer = int(params.slip_estimator == "observer")
    cycle.dead_band_linear, cycle.dead_band_angular = dead_band.dead_band_linear, dead_band.dead_band_angular
    cycle.pad_stiffness = params.gains.pad_stiffness
    cycle.slip_delay_ns, cycle.gate_shut = seconds_to_ns(params.slip_delay_s), int(gate_shut(params))
    cycle.models_wrench = int(params.wrench.source == "none")
    cycle.leaves_gravity = int(params.effort.gravity == "robot_compensates")
    cycle.k_s_adapts, cycle.k_s_margin = int(params.gains.k_s_mode != "fixed"), params.gains.k_s_margin
    cycle.drive_lag_s = params.drive_lag_s
    foresees = params.foresees_slip and cycle.gate_shut == 0
    cycle.slip_ahead_s = (1.0 - UNKNOWN_LAG) * params.drive_lag_s if foresees else 0.0
    if params.estimates_joints:
        cycle.kappa_share, cycle.kappa_late_s = DRIVE_SHARE, UNTOLD_S
    else:  # an arm that does what is commanded, at once
        cycle.kappa_share, cycle.kappa_late_s = 1.0, 0.0


def _fill_inputs(config: ControllerConfig, params: ControllerParams, robot: Robot, *, lockstep: bool) -> None:
    inputs = params.safety.inputs
    n, joint, limits = len(robot.joint_names), inputs.joint, config.joint
    limits.lower[:n], limits.upper[:n] = (
        robot.position_lower - SLACK,
        robot.position_upper + SLACK,
    )
    limits.fastest[:n] = robot.velocity_limit * FASTEST
    limits.jump, limits.clock_jump_ns = JUMP, round(CLOCK_JUMP_S * 1e9)
    limits.age_ns, limits.frozen_ns = round(joint.age_s * 1e9), round(inputs.frozen_s * 1e9)
    limits.accept_after = 1 if lockstep else ACCEPT_AFTER
    limits.still = params.joint_sensor.quantum_position / inputs.frozen_s
    wrench, slip = inputs.wrench, inputs.slip
    zero_after = params.wrench.zero_after
    _fill_vector(config.wrench, inputs, wrench, (wrench.force, wrench.torque), zero_is_normal=0, zero_after=zero_after)
    _fill_vector(config.slip, inputs, slip, (slip.linear, slip.angular), zero_is_normal=1)
    if params.slip_sensor.quantum_linear > 0.0:  # a slip that changes by less than a quantum reads the same
        config.slip.frozen_ns *= QUANTISED_REPEATS
    if params.slip_input == "flag":  # it may stay up, and no speed of it can contradict the wrench
        config.slip.frozen_ns = NEVER_FROZEN_NS


def _fill_vector(
    limits: VectorLimits,
    inputs: InputParams,
    params: WatchParams,
    largest: tuple[float, float],
    *,
    zero_is_normal: int,
    zero_after: int = 0,
) -> None:
    limits.age_ns, limits.frozen_ns = round(params.age_s * 1e9), round(inputs.frozen_s * 1e9)
    limits.future_ns, limits.zero_is_normal = round(FUTURE_S * 1e9), zero_is_normal
    limits.linear, limits.angular = largest
    limits.zero_after = zero_after


def _fill_modes(config: ControllerConfig, params: ControllerParams) -> None:
    safety, conditions = params.safety, config.conditions
    config.modes.auto_enable, config.modes.auto_resume = int(safety.auto_enable), int(safety.auto_resume)
    config.modes.resume_after_ns = seconds_to_ns(safety.resume_after_s)
    observer_s = safety.fallback.observer_s if params.slip_estimator == "observer" else 0.0
    for reason in Reason:
        conditions.lasts_ns[reason] = seconds_to_ns(reason.lasts_s) + 1 if reason.lasts_s else 0  # for longer
    conditions.lasts_ns[Reason.SLIP_SLOWS] = seconds_to_ns(observer_s)
    conditions.slow_down_ns = seconds_to_ns(STOPS_WITHIN * safety.fallback.slow_down_s)
    conditions.bridge_ns = seconds_to_ns(safety.inputs.bridge_s)
    unseen_s = min(safety.inputs.bridge_s + safety.fallback.slow_down_s, UNSEEN_SHARE * BLIND_S)
    conditions.unseen_ns = seconds_to_ns(unseen_s)
    conditions.gap_ns = seconds_to_ns(safety.inputs.joint.age_s)
    conditions.late_after = ACCEPT_AFTER
    conditions.slip_needed = int(params.controller != "classical")


def _fill_limits(config: ControllerConfig, safety: SafetyParams, robot: Robot, period_s: float) -> None:
    n, limits, motion, drive = len(robot.joint_names), safety.limits, config.motion, config.motion.drive
    velocity = robot.velocity_limit
    motion.near_lower[:n] = robot.position_lower + limits.position_margin
    motion.near_upper[:n] = robot.position_upper - limits.position_margin
    motion.margin, motion.velocity[:n] = limits.position_margin, velocity
    motion.brake_from[:n], motion.trip[:n] = velocity * BRAKE_SHARE, velocity * TRIP_SHARE
    motion.speed_linear, motion.speed_angular = limits.speed_linear, limits.speed_angular
    drive.effort[:n], drive.rate, drive.period_ns = robot.effort_limit, limits.effort_rate, seconds_to_ns(period_s)
    drive.longest_step_ns = seconds_to_ns(max(LONGEST_STEP_S, period_s))  # a control period is no pause
    drive.restart_after_ns = seconds_to_ns(RESTART_AFTER_S)


def _fill_command(config: ControllerConfig, params: ControllerParams, robot: Robot) -> None:
    """Write the limits of commands that are no efforts: those of limit avoidance, less what acceleration needs."""
    n, out, given, motion = len(robot.joint_names), config.command, params.command, config.motion
    out.interface, out.joints = Interface[given.interface.upper()], n
    out.velocity[:n], out.lead = motion.velocity[:n], LEAD
    sensor = params.joint_sensor
    out.lag = sensor.latency_s + sensor.filter_s + params.drive_lag_s + params.control_period_s
    out.acceleration[:n], out.jerk[:n] = given.acceleration_limit, given.jerk_limit
    out.lower[:n], out.upper[:n] = robot.position_lower, robot.position_upper


def _fill_drop(drop: DropDetectionConfig, params: ControllerParams) -> None:
    safety, g = params.safety, math.hypot(*params.gravity)
    if g > 0.0:  # without gravity nothing falls
        drop.down[:] = np.array(params.gravity) / g
    drop.drop_speed, drop.memory_s = safety.load.drop_speed, FALLS_WITHIN_S
    drop.error_linear, drop.error_angular = safety.limits.error_linear, safety.limits.error_angular


def _fill_observer(config: ControllerConfig, params: ControllerParams) -> None:
    if params.slip_estimator == "observer":
        _copy(config, "observer", observer_config(params), OBSERVER_CONFIG)


def _fill_hold(hold: HoldConfig, params: ControllerParams) -> None:
    safety, share = params.safety, 1.0 / hold.carriers
    slower = min(1.0, HOLD_PERIOD_S / params.control_period_s)
    hold.stiffness, hold.damping = (
        slower * slower * safety.hold_stiffness,
        slower * 2.0 * math.sqrt(safety.hold_stiffness),
    )
    hold.load_s = LOAD_S
    hold.least_load = LEAST_LOAD if share == 1.0 else 0.0  # several arms also feel what they press on each other
    hold.mass = share * params.object.mass
    hold.inertia[:] = share * inertia_from_six(params.object.inertia, "parameter object.inertia")
    hold.weight[:] = hold.mass * np.array(params.gravity)


def _fill_goals(goals: GoalsConfig, params: ControllerParams) -> None:
    goals.on = int(params.trajectory.kind == "goal")
    if params.governor.mode == "off":  # the governor slows down what is too fast; without it such a goal is refused
        limits = params.safety.limits
        goals.most_speed = BRAKED_FROM * limits.speed_linear
        goals.most_turning = BRAKED_FROM * limits.speed_angular


def _fill_grip(grip: GripConfig, given: GripParams) -> None:
    grip.follow, grip.nominal, grip.most = int(given.control == "follow"), given.nominal_force, given.force_limit
    grip.rate, grip.lag_s, grip.preview_s, grip.margin = (
        given.command_rate, given.lag_s, given.preview_s, given.margin
    )  # fmt: skip


def _fill_governor(governor: GovernorConfig, params: ControllerParams) -> None:
    given, path, sensor, limits = params.governor, params.trajectory, params.slip_sensor, params.safety.limits
    governed = path.kind != "hold"
    governor.mode = Governing[given.mode.upper()] if governed else Governing.OFF
    governor.margin, governor.path_margin, governor.given_up = given.margin, PATH_MARGIN, GIVEN_UP
    # Unknown friction is found by asking for more than is known to hold: all of it has to be asked.
    shared = SHARED_RESERVE if params.contacts.count > 1 else 0.0
    governor.reserve = given.reserve + shared * (1.0 - given.reserve) if given.friction != "unknown" else 0.0
    governor.radius, governor.slip_axes[:] = given.torsional_radius, params.contacts.slip_axes[:6]
    governor.gravity[:] = params.gravity
    last = path.waypoint_times_s[-1] if path.kind == "waypoints" and path.waypoint_times_s else path.duration_s
    governor.duration, governor.length, governor.floor = last, PATH_LENGTH_M, PATH_FLOOR_M_S
    governor.most_speed, governor.most_turning = BRAKED_FROM * limits.speed_linear, BRAKED_FROM * limits.speed_angular
    governor.most_grip = params.grip.force_limit / params.grip.nominal_force if params.grip.control == "follow" else 1.0
    governor.window = min(max(1, round(given.window_s / params.control_period_s)), MAX_WINDOW)
    # Several arms without a common path pull the object apart, and no way is left to brake in.
    governor.led = int(len(params.contacts.position) == 3)
    estimate = governor.estimate
    estimate.friction, estimate.configured, estimate.kept = Friction[given.friction.upper()], given.friction_limit, KEPT
    estimate.least, estimate.probe, estimate.trust = LEAST_SHARE * given.friction_limit, given.probe, TRUST
    noise = math.hypot(math.sqrt(2.0) * sensor.noise_linear, given.torsional_radius * sensor.noise_angular)
    estimate.threshold = max(LEAST_SLIP_M_S, NOISE_DEVIATIONS * noise, sensor.quantum_linear)
    estimate.noise_ns = seconds_to_ns(NOISE_S) if params.tare.duration_s > 0.0 else 0
    estimate.pre_sliding = given.pre_sliding
    estimate.witnesses = witnesses(params)
    estimate.confirmed = min(CONFIRMED, estimate.witnesses) if params.estimates_joints else 1
    estimate.quiet_ns = seconds_to_ns(QUIET_S)
    estimate.sensor_delay_ns = seconds_to_ns(sensor.latency_s + sensor.period_s)
