"""What is configured: parameters, arms and the CONFIG of the cycle, for each arm and for all that hold one object.

The one place where parameters become numbers of the cycle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np

from slip_core.arms import shared
from slip_core.arrays import Array, matrix_from_quat_xyzw, product
from slip_core.compiled import interpreted
from slip_core.errors import InputError
from slip_core.records import Records, copy_fields, new, place, record, records
from slip_core.stamps import seconds_to_ns
from slip_core.types import JointCommand
from slip_vic_controller.arm.command import Interface
from slip_vic_controller.arm.estimator import BLIND_S, ESTIMATOR_CONFIG, MEAN_S
from slip_vic_controller.config.joints import estimator_config
from slip_vic_controller.config.noise import fill_threshold
from slip_vic_controller.config.observer import TUNING, capacity, observer_config, slip_count
from slip_vic_controller.contact.friction_estimate import Friction
from slip_vic_controller.contact.observer import OBSERVER_CONFIG, ROW_SIZE
from slip_vic_controller.governor.grip import SINKS_S, Handover
from slip_vic_controller.governor.layouts import GovernorConfig
from slip_vic_controller.governor.plan import Governing
from slip_vic_controller.interfaces import fill_wrench_sensor
from slip_vic_controller.law.bounds import DRIVE_SHARE
from slip_vic_controller.law.config import LAW_CONFIG, make_law_config
from slip_vic_controller.law.contact import fill_contacts
from slip_vic_controller.law.gains import LAW_GAINS, UNKNOWN_LAG, gain_report, impedance_delay_s, judge_inertia
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.paths import PATH, make_path
from slip_vic_controller.robot import Robot
from slip_vic_controller.safety.conditions import Missing, Reason
from slip_vic_controller.safety.hold import fill_hold
from slip_vic_controller.safety.limits import LONGEST_STEP_S
from slip_vic_controller.safety.validation import ACCEPT_AFTER, SLACK
from slip_vic_controller.sizes import NEVER, ROOM
from slip_vic_controller.state import (
    ARM_SIZE,
    ARM_STATE,
    CONFIG,
    OUTPUTS,
    TASK_SIZE,
    TASK_STATE,
    ArmState,
    ControllerConfig,
)

LEAST_SHARE = 0.02
"""Least friction that is accepted, of the configured one."""
UNTOLD_S = 0.003
"""Unconfigured delay of efforts in the bound on kappa [s]: with 2 ms two arms oscillate at kappa 0.8."""
SHARED_RESERVE = 0.3
"""Share of what the weight, and `governor.reserve`, leave that the path of several arms does not use: one pad may bear
less than the others, the arms press on each other, and a camera sees what slips too late."""
CONFIRMED = 2
"""Slip samples in a row that are believed where the observer finds slip too, on an arm whose joints are estimated: it
finds some there that are none, and one sample may be an outlier."""
STOPS_WITHIN = 2.0
"""How much longer than a path that is slowed down one may need that friction has to brake."""
QUANTISED_REPEATS = 5
"""How many times as long a sensor with a quantum may repeat a reading before it counts as frozen."""

COMMON = (
    "mode", "control_period_s", "trajectory.kind", "governor.mode", "auto_activate", "expected_subscribers",
)  # fmt: skip
"""Parameters that are equal for all arms that hold one object: one process controls them."""
_COMMAND = place(OUTPUTS, "command")


class ArmController:
    """The configuration of one arm: parameters, arm, and the CONFIG of the cycle.

    Args:
        params: checked parameters.
        urdf_text: the arm; gives kinematics, dynamics and limits.
        lockstep: whether to wait for exactly the samples the bridge lists, and to take its stamps as the clock; one
            that jumps, and a position that does, are taken at once, since the bridge waits for the answer.
        arms: how many hold the object.

    Raises:
        InputError: the parameters and the URDF do not fit.
    """

    def __init__(self, params: ControllerParams, urdf_text: str, *, lockstep: bool, arms: int = 1) -> None:
        self.params, self.lockstep = params, lockstep
        armature = params.drive.of_joints("armature", len(params.joint_names))
        self.robot = Robot(urdf_text, params.ee_frame, params.joint_names, params.gravity, armature)
        self.config = _make_config(params, self.robot, lockstep=lockstep, arms=arms)
        self.gains = self.config[place(CONFIG, "gains")]
        self.wrist = judge_inertia(params, self.robot.joint_names, self.robot.inertia)
        self.contacts = params.contacts.count
        self.make_command = partial(JointCommand, interface=params.command.interface)
        self.command_place = slice(_COMMAND.start, _COMMAND.start + len(params.joint_names))
        self.external = params.trajectory.kind in ("topic", "goal")
        self.rows = capacity(params) if params.slip_estimator == "observer" else 0


class Controller:
    """The configuration of all arms that hold an object. Sessions may share it.

    Args:
        params: checked parameters of each arm by its name; the first arm leads along the path.
        urdfs: the arms.
        lockstep: whether to wait for exactly the samples the bridge lists, and to take its stamps as the clock.

    Raises:
        InputError: parameters and URDFs do not fit, or the arms do not fit each other.
    """

    def __init__(self, params: Mapping[str, ControllerParams], urdfs: Mapping[str, str], *, lockstep: bool) -> None:
        shared(params, COMMON, "all arms hold one object")
        self.lockstep = lockstep
        self.arms = {
            name: ArmController(of, urdfs[name], lockstep=lockstep, arms=len(params)) for name, of in params.items()
        }
        self.first = next(iter(self.arms.values()))
        self.rows = max(arm.rows for arm in self.arms.values())
        self.config = np.concatenate([arm.config for arm in self.arms.values()])
        self.config.setflags(write=False)

    def new_state(self) -> Array:
        """Return the state before the first cycle: TASK_STATE, ARM_STATE of each arm, histories of their observers."""
        n = len(self.arms)
        state = np.zeros(TASK_SIZE + n * (ARM_SIZE + self.rows * ROW_SIZE))
        record(state[:TASK_SIZE], TASK_STATE).path.scale = 1.0
        rows: Records[ArmState] = records(state[TASK_SIZE : TASK_SIZE + n * ARM_SIZE], ARM_STATE)
        for row, arm in zip(rows, self.arms.values(), strict=True):
            row.mode.enabled, row.mode.good_since_ns = record(arm.config, CONFIG).conditions.auto_enable, NEVER
            row.mode.reason.reason, row.mode.reason.which = Reason.WAITS, Missing.JOINT_STATES
            for condition in row.conditions:
                condition.since_ns = NEVER
            for slip in row.law.slips:
                slip.rotation[:] = np.eye(3)
            row.tare.begun_ns = row.tare.wrench_ns = NEVER
            row.observed.path_speed = 1.0
            row.tuned.start = row.tuned.target = record(arm.gains, LAW_GAINS)
            row.grip.command = row.grip.actual = max(arm.params.grip.nominal_force, arm.params.grip.least_force)
        return state


def _make_config(params: ControllerParams, robot: Robot, *, lockstep: bool, arms: int) -> Array:
    buffer = new(CONFIG)
    config = record(buffer, CONFIG)
    config.law = record(make_law_config(params, robot.effort_limit, robot.inertia), LAW_CONFIG)
    config.path = record(make_path(params.trajectory), PATH)
    if params.trajectory.of == "object":
        o_R_p = matrix_from_quat_xyzw(params.contacts.orientation_xyzw[:4])
        config.path.carries, config.path.lever[:] = 1, product(o_R_p.T, np.array(params.contacts.position[:3]))
    report = gain_report(params)
    config.gains, config.k_s_limit = record(report.gains, LAW_GAINS), report.accepted
    config.impedance_delay_s = impedance_delay_s(params)
    config.hold.carriers = max(arms, params.contacts.count)
    for part in (config.command, config.hold, config.tare):
        part.joints = len(robot.joint_names)
    if params.slip_estimator == "observer":
        config.observer = record(observer_config(params), OBSERVER_CONFIG)
    config.estimator = record(estimator_config(params, robot.effort_limit), ESTIMATOR_CONFIG)
    _fill_governor(config.governor, params)
    sensors = params.joint_sensor, params.slip_sensor, params.wrench_sensor
    copy_fields(config.tare, params.tare, params.object, *sensors)
    config.tare.slip_linear, config.tare.slip_angular = params.tare.slip
    config.tare.force, config.tare.torque = params.tare.wrench
    copy_fields(config.grip, params.grip)
    config.grip.follow, config.grip.preview_s = int(params.grip.control == "follow"), params.grip.lag_s + SINKS_S
    _fill_cycle(config, params)
    _fill_inputs(config, params, robot, lockstep=lockstep)
    _fill_conditions(config, params)
    _fill_limits(config, params, robot)
    _use_hold(config, params)
    fill_wrench_sensor(config.wrench_sensor, params, robot)
    buffer.setflags(write=False)
    return buffer


def renew_config(config: ControllerConfig, params: ControllerParams) -> None:
    """Take changed parameters into a CONFIG: what HOLD holds, and with which stiffness. Gains and payload of the law
    ramp, see `Ramp`; a change in HOLD is bounded by the effort limiter."""
    fill_contacts(params.contacts, config.law.contact)
    config.gains = record(gain_report(params).gains, LAW_GAINS)
    _use_hold(config, params)


def governed_stream(params: ControllerParams) -> bool:
    """Return whether references come by topic and are governed."""
    return params.trajectory.kind == "topic" and params.governor.mode != "off"


def _fill_cycle(cycle: ControllerConfig, params: ControllerParams) -> None:
    copy_fields(cycle, params, params.gains, params.slip_sensor, params.safety.fallback)
    cycle.period_ns, cycle.start_s = seconds_to_ns(params.control_period_s), params.trajectory.start_s
    cycle.has_observer = int(params.slip_estimator == "observer")
    cycle.follows_stream, cycle.follows_goals = int(governed_stream(params)), int(params.trajectory.kind == "goal")
    # A flag reports no speed; and with a governor, which prevents slip, compensation only responds to noise and delays.
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
    # So that the arm rests by the time at which the model no longer gives its position.
    unseen_s = min(safety.inputs.bridge_s + safety.fallback.slow_down_s, BLIND_S - safety.inputs.age_s)
    conditions.unseen_ns = seconds_to_ns(unseen_s)
    conditions.slip_needed = int(params.controller != "classical")
    copy_fields(config.drop, safety.load, safety.limits)
    if any(params.gravity):  # without gravity nothing falls
        config.drop.down[:] = np.array(params.gravity) / math.hypot(*params.gravity)


def _fill_limits(config: ControllerConfig, params: ControllerParams, robot: Robot) -> None:
    n, limits, least = len(robot.joint_names), config.command, float(max(robot.effort_limit * robot.velocity_limit))
    if params.command.interface == "effort" and params.safety.limits.effort_rate < least:
        raise InputError(
            "parameter safety.limits.effort_rate", got=f"{params.safety.limits.effort_rate:g} N m/s",
            expected=f"at least {least:g} N m/s, as fast as a load at a joint's limits of effort and velocity changes",
        )  # fmt: skip
    copy_fields(limits, params.safety.limits)
    limits.interface = Interface[params.command.interface.upper()]
    limits.effort[:n], limits.velocity[:n] = robot.effort_limit, robot.velocity_limit
    limits.acceleration[:n] = params.command.acceleration_limit
    limits.lower[:n], limits.upper[:n] = robot.position_lower, robot.position_upper
    limits.period_ns, limits.lag_s = config.period_ns, params.known_lag_s
    limits.restart_after_ns = seconds_to_ns(params.safety.inputs.age_s)
    limits.longest_step_ns = max(seconds_to_ns(LONGEST_STEP_S), config.period_ns)  # a control period is no pause


def _use_hold(config: ControllerConfig, params: ControllerParams) -> None:
    of, stiffness = config.gains.object, params.safety.hold_stiffness
    interpreted(fill_hold)(config.hold, of.mass, of.inertia, of.gravity, stiffness, config.impedance_delay_s)


def _fill_governor(governor: GovernorConfig, params: ControllerParams) -> None:
    given, path, sensor, limits = params.governor, params.trajectory, params.slip_sensor, params.safety.limits
    copy_fields(governor, given)
    governor.mode = Governing[given.mode.upper()] if path.kind != "hold" else Governing.OFF
    # Unknown friction is found by asking for more than is known to hold: all of it has to be asked.
    shared = SHARED_RESERVE if params.contacts.count > 1 else 0.0
    governor.reserve = given.reserve + shared * (1.0 - given.reserve) if given.friction != "unknown" else 0.0
    governor.radius, governor.slip_axes[:] = given.torsional_radius, params.contacts.slip_axes[:6]
    governor.weights[:3], governor.weights[3:] = governor.slip_axes[:3], governor.slip_axes[3:] / governor.radius
    force, torque = params.wrench_sensor.bias_force, params.wrench_sensor.bias_torque
    governor.bias = math.hypot(force, torque * governor.weights[3:].max())
    governor.gravity[:] = params.gravity
    governor.duration = path.duration_s
    governor.most_speed, governor.most_turning = limits.speed_linear, limits.speed_angular
    governor.most_grip = params.grip.cap / params.grip.nominal_force if params.grip.control == "follow" else 1.0
    governor.window = min(max(1, round(given.window_s / params.control_period_s)), ROOM)
    governor.disturbed = int(params.estimates_joints and params.command.interface == "effort")
    # Several arms without a common path pull the object apart, and no way is left to brake in.
    governor.led = int(len(params.contacts.position) == 3)
    estimate = governor.friction
    copy_fields(estimate, given)
    estimate.friction, estimate.configured = Friction[given.friction.upper()], given.friction_limit
    estimate.least = LEAST_SHARE * given.friction_limit
    estimate.quantum = math.inf if params.slip_input == "flag" else sensor.quantum_linear
    estimate.least_threshold = max(TUNING.least_slip[0], sensor.quantum_linear)
    interpreted(fill_threshold)(governor, sensor.noise_linear, sensor.noise_angular)
    estimate.noise_ns = seconds_to_ns(MEAN_S) if params.tare.duration_s > 0.0 else 0
    estimate.slip_count = slip_count(params)
    estimate.confirmed = min(CONFIRMED, estimate.slip_count) if params.estimates_joints else 1
    estimate.sensor_delay_ns = seconds_to_ns(sensor.latency_s + sensor.period_s)
