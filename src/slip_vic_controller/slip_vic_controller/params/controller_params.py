"""Parameters of the controller, declared once; names and units as in docs/equations.md."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, field_validator, model_validator

from slip_core import device_params, grasp_params
from slip_core.device_params import (
    SLIP_INPUT,
    CommandInterface,
    DriveModel,
    GripperModel,
    JointSensorModel,
    SlipInput,
    SlipSensorModel,
)
from slip_core.grasp_params import ArmParams, BaseParams, Six, Three
from slip_core.params import ParameterModel, parameter, parameter_unit, range_of

FOLLOWED = 2.5
"""Phase [rad] that the drives' lag may cost at the crossover of the impedance: the estimate takes it out as far as the
lag is known, and a third of it leaves 40 degrees."""
FOLLOWED_BY_EFFORT = 0.8
"""The same phase [rad] with effort commands: no drive loop closes on a predicted velocity."""


class GainParams(ParameterModel):
    """Impedance and slip gains; the defaults are the paper's (Sec. IV), its planar values repeated on all axes."""

    stiffness: Six = parameter(
        (5.0, 5.0, 5.0, 4.5, 4.5, 4.5),
        "stiffness K_D: x, y, z, about x, y, z",
        unit="N/m, N m/rad", runtime=True,
    )  # fmt: skip
    damping: Six = parameter(
        (2.5, 2.5, 2.5, 2.2, 2.2, 2.2), "damping D_D: x, y, z, about x, y, z", unit="N s/m, N m s/rad", runtime=True
    )
    inertia: Six = parameter(
        (0.4, 0.4, 0.4, 0.3, 0.3, 0.3), "inertia M_D: x, y, z, about x, y, z", unit="kg, kg m2", runtime=True
    )
    gamma_kp: float = parameter(100.0, "fading rate of linear stiffness with slip", unit="s/m", runtime=True, ge=0.0)
    gamma_ko: float = parameter(100.0, "fading rate of angular stiffness with slip", unit="s/rad", runtime=True, ge=0.0)
    gamma_dp: float = parameter(100.0, "fading rate of linear damping with slip", unit="s/m", runtime=True, ge=0.0)
    gamma_do: float = parameter(100.0, "fading rate of angular damping with slip", unit="s/rad", runtime=True, ge=0.0)
    alpha: float = parameter(
        100.0, "steepness of the slip activation tanh(alpha |v_s|)", unit="s/m", runtime=True, gt=0.0
    )
    k_s: float = parameter(
        1000.0, "decay rate of slip while the slip activation is near 1", unit="1/s", runtime=True, gt=0.0
    )
    k_s_margin: float = parameter(
        2.0, "gain margin of the slip loop: k_s is limited to its stability limit divided by this", ge=1.0
    )
    spin: Literal["follow", "bounded"] = parameter(
        "follow", "attitude in slip. follow: turn with the object (the printed law); bounded: at most by spin_excursion"
    )
    spin_excursion: float = parameter(
        0.05, "spin bounded: largest static attitude error from following the spin", unit="rad", runtime=True, ge=0.0
    )
    characteristic_length: float = parameter(
        0.03,
        "spin bounded: length that converts angular to linear slip speed in the slip activation (printed law: 1 m)",
        unit="m",
        runtime=True,
        ge=0.0,
    )

    kappa: float = parameter(
        0.0, "several contacts: gain of yielding to the internal wrench, a_C += kappa M_D^-1 h_int; about 1",
        runtime=True, ge=0.0,
    )  # fmt: skip
    pad_stiffness: float = parameter(
        2.0e4, "several contacts: largest stiffness of the pads, for the bound on kappa", unit="N/m", gt=0.0
    )
    ramp_s: float = parameter(
        0.2, "shortest ramp for a change of gains or payload at run time; stability may require a longer one", unit="s",
        runtime=True, gt=0.0,
    )  # fmt: skip

    @model_validator(mode="after")
    def _positive(self) -> GainParams:
        for name in ("stiffness", "damping", "inertia"):
            values = getattr(self, name)
            unit = parameter_unit(type(self), name)
            if min(values) < range_of(unit)[0]:
                raise ValueError(
                    f"{name} {list(values)}: every gain must be positive, at least {range_of(unit)[0]:g} {unit}"
                )
        return self


class ObjectParams(grasp_params.ObjectParams):
    """The grasped object, taken as known."""

    AT_RUNTIME = frozenset({"mass", "inertia"})


class ContactParams(grasp_params.ContactParams):
    """Contacts on the object, taken as known; contact 0 is this controller's own arm."""

    AT_RUNTIME = frozenset({"position"})


class GovernorParams(ParameterModel):
    """Reference governor: how fast a built-in trajectory is run through, so that friction carries the object."""

    mode: Literal["off", "slow_down", "time_optimal"] = parameter(
        "off", "off: the path as given; slow_down: never faster than given; time_optimal: as fast as friction admits"
    )

    @field_validator("mode", mode="before")
    @classmethod
    def _off_is_a_word(cls, value: object) -> object:
        """YAML reads a bare `off` as false."""
        return "off" if value is False else value

    margin: float = parameter(0.95, "fraction of the friction limit that a motion may use", gt=0.0, le=1.0)
    reserve: float = parameter(
        0.0, "fraction of the remaining friction (after weight) reserved for drive errors; several arms reserve "
        "another 0.3 of the rest; unused with friction unknown",
        ge=0.0, lt=1.0,
    )  # fmt: skip
    friction: Literal["known", "learnt", "unknown"] = parameter(
        "learnt", "known: as configured; learnt: lowered by slips; unknown: found by increasing the load step by step"
    )
    friction_limit: float = parameter(
        0.25, "largest friction force of the grasp; with friction unknown, the largest load that is tried", unit="N",
        gt=0.0,
    )  # fmt: skip
    torsional_radius: float = parameter(0.03, "largest friction torque over largest friction force", unit="m", gt=0.0)
    pre_sliding: float = parameter(
        0.0, "displacement by which soft pads shear before they slip: slow slip counts only beyond it", unit="m", ge=0.0
    )  # fmt: skip
    probe: float = parameter(
        0.01, "load beyond the largest one carried: friction unknown, or catching up with the path", unit="N", gt=0.0
    )
    preview_s: float = parameter(
        0.1, "reference by topic: delay with which it is followed, and thus how far ahead it is known",
        unit="s", gt=0.0,
    )  # fmt: skip
    window_s: float = parameter(
        0.02, "time over which the governor averages position, speed and acceleration on the path", unit="s", ge=0.0
    )


class NullspaceParams(ParameterModel):
    """Posture torque in the null space of the task, towards the joint positions at which the law begins."""

    stiffness: float = parameter(
        10.0, "joint stiffness towards the posture, in the null space of the task", unit="N m/rad", runtime=True, ge=0.0
    )
    damping: float = parameter(
        2.0, "joint damping in the null space of the task", unit="N m s/rad", runtime=True, ge=0.0
    )


class SingularityParams(ParameterModel):
    """Damping near singular postures of the arm."""

    sigma_min: float = parameter(0.04, "smallest singular value of J below which damping starts", runtime=True, gt=0.0)
    damping: float = parameter(0.1, "largest damping on J B^-1 J^T, squared when added", unit="kg^-1/2", gt=0.0)


class TrajectoryParams(ParameterModel):
    """The built-in reference, relative to the pose of {ee} at the first tick, on world axes."""

    kind: Literal["hold", "quintic", "waypoints", "circle", "lemniscate", "topic", "goal"] = parameter(
        "hold", "reference motion; topic and goal hold until the first message arrives"
    )
    start_s: float = parameter(0.0, "time at rest before the motion", unit="s", ge=0.0)
    duration_s: float = parameter(2.0, "duration, ramps included; also of goals without a time", unit="s", gt=0.0)
    displacement: Three = parameter((0.0, 0.0, 0.0), "quintic: displacement from the start", unit="m")
    of: Literal["pad", "object"] = parameter(
        "pad", "what follows the path: the pad, or the object's centre of mass with the pad where it grasped the object"
    )
    rotation: Three = parameter(
        (0.0, 0.0, 0.0), "quintic: rotation vector; circle and lemniscate: its amplitude", unit="rad"
    )
    waypoints: tuple[float, ...] = parameter(
        (), "waypoints: x y z rx ry rz per point, without the start; at equal intervals over duration_s", unit="m, rad"
    )
    plane: Literal["xy", "yz", "zx"] = parameter(
        "xy", "circle, lemniscate: plane on world axes; the motion starts along the first axis"
    )
    radius: float = parameter(0.1, "circle: radius; lemniscate: half its length", unit="m", gt=0.0)
    period_s: float = parameter(4.0, "circle, lemniscate: time of one round at full speed", unit="s", gt=0.0)
    ramp_s: float = parameter(1.0, "circle, lemniscate: time to reach full speed, and to stop", unit="s", gt=0.0)

    @model_validator(mode="after")
    def _consistent(self) -> TrajectoryParams:
        if math.hypot(*self.rotation) > math.pi and self.kind != "hold":
            raise ValueError(f"rotation {list(self.rotation)}: the angle must be at most pi")
        if self.kind in ("circle", "lemniscate") and self.duration_s < 2.0 * self.ramp_s:
            raise ValueError(f"duration_s {self.duration_s}: at least 2 ramp_s = {2.0 * self.ramp_s} is needed")
        if self.kind == "waypoints":
            count, rest = divmod(len(self.waypoints), 6)
            if count < 1 or rest:
                raise ValueError(f"waypoints has {len(self.waypoints)} values, expected 6 for each point, at least one")
        return self


class WrenchParams(ParameterModel):
    """Conventions of the wrench sensor's driver; wrenches at contacts of other arms are used as they are, at the
    pad."""

    source: Literal["sensor", "none"] = parameter(
        "sensor",
        "sensor: from the topic `wrench`; none: no wrench sensor, the load is modelled for an object that moves "
        "along the path without slip",
    )
    frame: str = parameter(
        "", "frame of the wrench messages; empty = ee_frame. A link of the URDF needs no position and rpy"
    )
    position: Three = parameter(
        (0.0, 0.0, 0.0), "position of the sensor frame in ee_frame, if it is no link of the URDF", unit="m"
    )
    rpy: Three = parameter(
        (0.0, 0.0, 0.0),
        "orientation of the sensor frame in ee_frame, if it is not a link of the URDF: rotations about the fixed x, "
        "y and z axes, in this order",
        unit="rad",
    )
    sign: Literal[1, -1] = parameter(
        1, "1: the driver reports the wrench of the object on the robot; -1: of the robot on the object"
    )
    force_scale: float = parameter(1.0, "factor that converts the driver's forces to newtons", gt=0.0)
    torque_scale: float = parameter(1.0, "factor that converts the driver's torques to newton metres", gt=0.0)
    tool_mass: float = parameter(
        0.0, "mass between sensor and pad; its weight is subtracted from the wrench", unit="kg", ge=0.0
    )
    tool_com: Three = parameter((0.0, 0.0, 0.0), "centre of mass of tool_mass in ee_frame", unit="m")


class WrenchSensorModel(device_params.WrenchSensorModel):
    """What is known of the wrench sensor, and by how much it may be off."""

    bias_force: float = parameter(0.1, "expected size of a constant force error", unit="N", gt=0.0)
    bias_torque: float = parameter(2e-3, "expected size of a constant torque error", unit="N m", gt=0.0)


class EffortParams(ParameterModel):
    """What the arm's drives make of an effort."""

    gravity: Literal["include", "robot_compensates"] = parameter(
        "include",
        "include: commanded efforts include gravity compensation of the arm; robot_compensates: the arm adds it",
    )


class CommandParams(ParameterModel):
    """What the arm's drives take, and the limits of velocities and positions; those of efforts are `safety.limits`."""

    interface: CommandInterface = parameter(
        "effort",
        "effort [N m] on `effort_command`, velocity [rad/s] on `velocity_command`, or position [rad] on "
        "`position_command`; the last two for drives that close their own loop",
    )
    acceleration_limit: float = parameter(
        10.0, "interfaces velocity and position: largest commanded acceleration of each joint", unit="rad/s^2",
        gt=0.0, le=1e4,
    )  # fmt: skip


class GripParams(GripperModel):
    """Grip as a second output, where the gripper can follow and the object may be squeezed."""

    nominal_force: float = parameter(
        0.5, "grip force at which governor.friction_limit applies; control follow: also the grip at the start, and "
        "the minimum in HOLD", unit="N", gt=0.0,
    )  # fmt: skip
    cap: float = parameter(
        10.0, "control follow: largest grip that object and gripper withstand; the path is planned for it", unit="N",
        gt=0.0,
    )  # fmt: skip
    error_force: float = parameter(
        0.0, "control follow: largest shortfall of the force, from the gripper's steps and friction",
        unit="N", ge=0.0,
    )  # fmt: skip
    risk: float = parameter(
        5e-3, "control follow: accepted probability that friction carries less than assumed", gt=0.0, lt=0.5
    )


class JointSensorConfig(JointSensorModel):
    """Joint sensor, as configured; the launcher fills it from the drive's preset.

    Without noise of the velocities and without a quantum the samples are used as they are, and nothing is estimated.
    """

    @property
    def estimates(self) -> bool:
        """Whether the joint state is estimated: where something is known of the noise."""
        return self.noise_velocity > 0.0 or self.quantum_position > 0.0

    @property
    def filter_s(self) -> float:
        """Time constant of the filter of velocities, 0 without one [s]."""
        return 1.0 / (2.0 * math.pi * self.velocity_filter_hz) if self.velocity_filter_hz > 0.0 else 0.0


class TareParams(ParameterModel):
    """Tare at rest: bias and noise of the sensors, measured in HOLD before the law begins."""

    duration_s: float = parameter(
        0.0, "time at rest over which sensor bias and noise are measured; 0 = no tare", unit="s", ge=0.0, le=10.0
    )
    slip: tuple[float, float] = parameter(
        (0.02, 0.3), "largest bias of the slip velocity that is removed, linear and angular", unit="m/s, rad/s"
    )
    wrench: tuple[float, float] = parameter(
        (0.3, 0.03), "largest bias of force and torque that is removed", unit="N, N m"
    )
    mass_share: float = parameter(
        0.5,
        "largest deviation of the measured mass from object.mass, as a fraction of it; the law uses the measured mass",
        ge=0.0,
        lt=1.0,
    )


class DisturbanceParams(ParameterModel):
    """Joint accelerations that the model of the arm leaves out: friction, torque offset, a push."""

    drift: float = parameter(
        3.0, "random walk of the disturbance: standard deviation after one second", unit="rad/s^2", gt=0.0, le=1e4
    )
    limit: float = parameter(
        0.25, "largest compensation of the disturbance, as a fraction of the joint's effort limit", ge=0.0, le=1.0
    )


class LimitParams(ParameterModel):
    """What no command exceeds, whatever mode it comes from; effort and velocity limits themselves are the URDF's."""

    effort_rate: float = parameter(1000.0, "largest rate of change of a joint's effort", unit="N m/s", gt=0.0)
    position_margin: float = parameter(
        0.1,
        "distance to a joint limit at which the joint is pushed back, by an effort that grows to its limit",
        unit="rad",
        gt=0.0,
    )
    speed_linear: float = parameter(
        2.25, "largest pad speed of goals and governed paths; FAULT at 1.5 times this", unit="m/s", gt=0.0
    )
    speed_angular: float = parameter(
        7.5, "largest angular pad speed of goals and governed paths; FAULT at 1.5 times this", unit="rad/s", gt=0.0
    )
    error_linear: float = parameter(
        0.3, "position error at which motion along the path stops; it slows down from half of this", unit="m", gt=0.0
    )
    error_angular: float = parameter(
        6.0, "attitude error at which motion along the path stops; it slows down from half of this", unit="rad", gt=0.0
    )


class InputParams(ParameterModel):
    """Plausibility of the inputs; positions and velocities of the joints are judged against the URDF's limits."""

    age_s: float = parameter(0.05, "age above which the newest joint state or wrench is not used", unit="s", gt=0.0)
    slip_age_s: float = parameter(0.15, "age above which the newest slip velocity is not used", unit="s", gt=0.0)
    wrench: tuple[float, float] = parameter(
        (1000.0, 200.0), "largest force and torque that are accepted", unit="N, N m"
    )
    slip: tuple[float, float] = parameter(
        (5.0, 100.0), "largest linear and angular slip speed that are accepted", unit="m/s, rad/s"
    )
    frozen_s: float = parameter(
        0.1, "longest time for which readings may repeat exactly while the arm moves", unit="s", gt=0.0
    )
    bridge_s: float = parameter(
        0.05, "longest gap in joint states that the law bridges with the modelled motion", unit="s", ge=0.0
    )


class FallbackParams(ParameterModel):
    """What happens without slip velocity: law on the observer's prediction, then slower, then HOLD."""

    observer_s: float = parameter(
        0.3,
        "longest time for which the observer may run on the wrench alone; without an observer it is skipped",
        unit="s",
        ge=0.0,
    )
    slow_down_s: float = parameter(
        0.5,
        "time in which motion along the path comes to rest; twice this where friction limits braking",
        unit="s",
        gt=0.0,
    )


class LoadParams(ParameterModel):
    """Drop detection: an object that falls."""

    drop_speed: float = parameter(
        0.3, "downward speed of a slipping object relative to the reference that is a FAULT", unit="m/s", gt=0.0
    )


class SafetyParams(ParameterModel):
    """Modes, and the command that is sent when the law is not used."""

    hold_stiffness: float = parameter(
        225.0,
        "joint stiffness over joint inertia in HOLD: square of the natural frequency; damping is critical",
        unit="1/s^2",
        runtime=True,
        ge=0.0,
    )
    auto_enable: bool = parameter(True, "true: enter ACTIVE as soon as the inputs are good; false: wait for ~/enable")
    resume_after_s: float = parameter(
        0.1, "how long inputs must be good before the controller leaves HOLD by itself", unit="s", ge=0.0
    )
    limits: LimitParams = Field(default_factory=LimitParams)
    inputs: InputParams = Field(default_factory=InputParams)
    fallback: FallbackParams = Field(default_factory=FallbackParams)
    load: LoadParams = Field(default_factory=LoadParams)


class ControllerParams(ArmParams):
    """All parameters of one arm of the controller, and how its node runs."""

    controller: Literal["vic", "printed", "classical"] = parameter(
        "vic",
        "vic: the paper's law, with bounded slip compensation where joint states or slip are estimated; printed: the "
        "paper's law without that bound; classical: the same law without slip activation and fading",
    )
    mode: Literal["lockstep", "realtime"] = parameter(
        "lockstep", "lockstep: wait for all samples of a stamp; realtime: answer each joint state with the newest"
    )
    control_period_s: float = parameter(0.001, "control period", unit="s", ge=1e-5, le=1.0)
    attitude: Literal["log", "rpy"] = parameter("log", "orientation error: rotation vector, or roll, pitch, yaw")
    object: ObjectParams = Field(default_factory=ObjectParams)
    contacts: ContactParams = Field(default_factory=ContactParams)
    gains: GainParams = Field(default_factory=GainParams)
    slip_input: SlipInput = SLIP_INPUT
    slip_delay_s: float = parameter(
        0.0, "delay between the measurement and the stamp of a slip message", unit="s", ge=0.0
    )
    slip_estimator: Literal["measured", "observer"] = parameter(
        "measured", "slip velocity in the law: measured: the newest sample (the printed law); observer: an estimate"
    )
    slip_sensor: SlipSensorModel = Field(default_factory=SlipSensorModel)
    wrench_sensor: WrenchSensorModel = Field(default_factory=WrenchSensorModel)
    joint_sensor: JointSensorConfig = Field(default_factory=JointSensorConfig)
    disturbance: DisturbanceParams = Field(default_factory=DisturbanceParams)
    drive: DriveModel = Field(default_factory=DriveModel)
    command: CommandParams = Field(default_factory=CommandParams)
    tare: TareParams = Field(default_factory=TareParams)
    wrench: WrenchParams = Field(default_factory=WrenchParams)
    effort: EffortParams = Field(default_factory=EffortParams)
    grip: GripParams = Field(default_factory=GripParams)
    handover: Literal["hold", "follow", "open"] = parameter(
        "hold", "reaction to a hand that pulls at the object at the end of a governed path. hold: stay; follow: "
        "yield, and stay where the hand lets go; open: open the grip (needs grip.control follow)",
    )  # fmt: skip
    governor: GovernorParams = Field(default_factory=GovernorParams)
    nullspace: NullspaceParams = Field(default_factory=NullspaceParams)
    singularity: SingularityParams = Field(default_factory=SingularityParams)
    safety: SafetyParams = Field(default_factory=SafetyParams)
    trajectory: TrajectoryParams = Field(default_factory=TrajectoryParams)
    expected_subscribers: int = parameter(
        1,
        "subscribers to wait for on `effort_command` before `controller/ready` is sent (bridge, recorder if used)",
        ge=1,
    )
    auto_activate: bool = parameter(
        True, "true: configure and activate at start; false: wait for the lifecycle services (managed node)"
    )
    publish_effort_array: bool = parameter(
        False, "also publish `effort_controller/commands` (Float64MultiArray) for ros2_control"
    )
    base: BaseParams = Field(default_factory=BaseParams)

    @model_validator(mode="after")
    def _grip_follows_a_governed_path(self) -> ControllerParams:
        if self.grip.control == "follow":
            if self.governor.mode == "off":
                raise ValueError("grip.control follow needs a governed path: set governor.mode")
            if self.grip.cap < self.grip.nominal_force:
                raise ValueError(f"grip.cap {self.grip.cap} must not be below grip.nominal_force")
        elif self.handover == "open":
            raise ValueError("handover open needs a commanded grip: set grip.control follow")
        return self

    @property
    def drive_lag_s(self) -> float:
        """Time from a command to its motion: dead time plus the lag of the drives [s]."""
        own_loop = self.command.interface != "effort"
        return self.drive.delay_s + (1.0 / self.drive.bandwidth if own_loop else self.drive.lag_s)

    @property
    def known_lag_s(self) -> float:
        """Time from a command to the motion that the joint state shows [s]."""
        return self.drive_lag_s + self.joint_sensor.latency_s + self.joint_sensor.filter_s

    @property
    def estimates_joints(self) -> bool:
        """Whether the joint state is estimated: where it may be noisy, or drives follow commands with a lag."""
        return self.joint_sensor.estimates or self.tare.duration_s > 0.0 or self.drive_lag_s > 0.0

    @property
    def bounded_authority(self) -> bool:
        """Whether the compensation's authority is bounded: where the law uses estimates."""
        return self.controller != "printed" and (self.estimates_joints or self.slip_estimator == "observer")

    @property
    def foresees_slip(self) -> bool:
        """Whether the law works with the slip velocity to which the commands under way lead."""
        return self.command.interface != "effort" and self.slip_estimator == "observer"

    @property
    def fastest_rate(self) -> float:
        """Largest rate D/M of an impedance that drives of this lag can follow without swinging [1/s]."""
        followed = FOLLOWED_BY_EFFORT if self.command.interface == "effort" else FOLLOWED
        return followed / self.drive_lag_s if self.drive_lag_s > 0.0 else math.inf

    @model_validator(mode="after")
    def _drives_fit_the_arm(self) -> ControllerParams:
        self.drive.check(len(self.joint_names))
        return self

    @model_validator(mode="after")
    def _a_flag_is_no_speed(self) -> ControllerParams:
        if self.slip_input == "flag" and self.slip_estimator == "observer":
            raise ValueError("slip_estimator observer needs slip velocities: with slip_input flag use measured")
        return self
