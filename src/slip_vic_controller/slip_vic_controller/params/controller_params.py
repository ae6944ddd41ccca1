"""Parameters of the controller, declared once; names and units as in docs/equations.md."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field, field_validator, model_validator

from slip_core import grasp_params
from slip_core.device_params import SLIP_INPUT, DriveModel, SlipInput, SlipSensorModel
from slip_core.grasp_params import ArmParams, Six, Three
from slip_core.params import ParameterModel, parameter, parameter_unit, range_of
from slip_vic_controller.params.arm_params import DisturbanceParams, JointSensorConfig, TareParams
from slip_vic_controller.params.interface_params import (
    CommandParams,
    EffortParams,
    GripParams,
    WrenchParams,
    WrenchSensorModel,
)
from slip_vic_controller.params.safety_params import SafetyParams

FOLLOWED = 2.5
"""Phase [rad] that the drives' lag may cost at the crossover of the impedance: the estimate takes it out as far as the
lag is known, and a third of it leaves 40 degrees."""
FOLLOWED_BY_EFFORT = 0.8
"""The same phase [rad] with effort commands: no drive loop closes on a predicted velocity."""


class GainParams(ParameterModel):
    """Impedance and slip gains; the defaults are the paper's (Sec. IV), its planar values repeated on all axes."""

    stiffness: Six = parameter(
        (5.0, 5.0, 5.0, 4.5, 4.5, 4.5),
        "K_D, x y z then about x y z",
        unit="N/m, N m/rad", runtime=True,
    )  # fmt: skip
    damping: Six = parameter(
        (2.5, 2.5, 2.5, 2.2, 2.2, 2.2), "D_D, x y z then about x y z", unit="N s/m, N m s/rad", runtime=True
    )
    inertia: Six = parameter(
        (0.4, 0.4, 0.4, 0.3, 0.3, 0.3), "M_D, x y z then about x y z", unit="kg, kg m2", runtime=True
    )
    gamma_kp: float = parameter(100.0, "fading of linear stiffness with slip", unit="s/m", runtime=True, ge=0.0)
    gamma_ko: float = parameter(100.0, "fading of angular stiffness with slip", unit="s/rad", runtime=True, ge=0.0)
    gamma_dp: float = parameter(100.0, "fading of linear damping with slip", unit="s/m", runtime=True, ge=0.0)
    gamma_do: float = parameter(100.0, "fading of angular damping with slip", unit="s/rad", runtime=True, ge=0.0)
    alpha: float = parameter(
        100.0, "steepness of the slip activation tanh(alpha |v_s|)", unit="s/m", runtime=True, gt=0.0
    )
    k_s: float = parameter(
        1000.0, "decay rate of slip while the slip activation is near 1", unit="1/s", runtime=True, gt=0.0
    )
    k_s_margin: float = parameter(
        2.0, "gain margin of the slip loop: k_s is used up to its stability limit divided by this", ge=1.0
    )
    spin: Literal["follow", "bounded"] = parameter(
        "follow", "attitude in slip: follow the object's spin (the printed law), or only as far as spin_excursion"
    )
    spin_excursion: float = parameter(
        0.05, "spin bounded: static attitude error that following the object may cost", unit="rad", runtime=True, ge=0.0
    )
    characteristic_length: float = parameter(
        0.03,
        "spin bounded: length that makes an angular slip speed comparable with a linear one in the slip activation "
        "(the printed law has 1 m)",
        unit="m",
        runtime=True,
        ge=0.0,
    )

    kappa: float = parameter(
        0.0, "several contacts: how much the pad gives way to its internal wrench, a_C += kappa M_D^-1 h_int; about 1",
        runtime=True, ge=0.0,
    )  # fmt: skip
    pad_stiffness: float = parameter(
        2.0e4, "several contacts: stiffest direction of the pads, for the bound on kappa", unit="N/m", gt=0.0
    )
    ramp_s: float = parameter(
        0.2, "shortest time that a change of gains or payload at run time takes; stability may ask for more", unit="s",
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
        "off", "off: the trajectory as planned; slow_down: never faster than that; time_optimal: its path, fastest"
    )

    @field_validator("mode", mode="before")
    @classmethod
    def _off_is_a_word(cls, value: object) -> object:
        """YAML reads a bare `off` as false."""
        return "off" if value is False else value

    margin: float = parameter(0.95, "share of the friction limit that a motion may ask", gt=0.0, le=1.0)
    reserve: float = parameter(
        0.0, "share of the friction that the weight leaves which the path does not use: it is for what drives add; "
        "several arms leave 0.3 of the rest too; not with friction unknown",
        ge=0.0, lt=1.0,
    )  # fmt: skip
    friction: Literal["known", "learnt", "unknown"] = parameter(
        "learnt",
        "known: as configured; learnt: reduced where it slips; unknown: found by loading a little more each time",
    )
    friction_limit: float = parameter(
        0.25, "friction force of the grasp, as configured; with friction unknown the most that is tried", unit="N",
        gt=0.0,
    )  # fmt: skip
    torsional_radius: float = parameter(0.03, "largest friction torque over largest friction force", unit="m", gt=0.0)
    pre_sliding: float = parameter(
        0.0, "way that soft pads give before they slip: a slow slip counts only after it", unit="m", ge=0.0
    )  # fmt: skip
    probe: float = parameter(
        0.01, "load asked beyond the largest one carried: friction unknown, or a path that catches up", unit="N", gt=0.0
    )
    preview_s: float = parameter(
        0.1, "reference by topic: time by which it is followed later, so that what comes is known so far ahead",
        unit="s", gt=0.0,
    )  # fmt: skip
    window_s: float = parameter(
        0.02, "time over which position, velocity and acceleration are averaged", unit="s", ge=0.0
    )


class NullspaceParams(ParameterModel):
    """Posture torque in the null space of the task."""

    stiffness: float = parameter(
        10.0, "joint stiffness towards the posture, in the null space of the task", unit="N m/rad", runtime=True, ge=0.0
    )
    damping: float = parameter(
        2.0, "joint damping in the null space of the task", unit="N m s/rad", runtime=True, ge=0.0
    )
    posture: tuple[float, ...] = parameter(
        (), "joint positions that the null space is pulled to; empty = the first that are measured", unit="rad"
    )


class SingularityParams(ParameterModel):
    """Damping near singular postures of the arm."""

    sigma_min: float = parameter(0.04, "singular value of J below which damping starts", runtime=True, gt=0.0)
    damping: float = parameter(0.1, "largest damping on J B^-1 J^T, squared when added", unit="kg^-1/2", gt=0.0)


class TrajectoryParams(ParameterModel):
    """The built-in reference, relative to the pose of {ee} at the first tick, on world axes."""

    kind: Literal["hold", "quintic", "waypoints", "circle", "lemniscate", "topic", "goal"] = parameter(
        "hold",
        "form of the reference motion; `topic` and `goal` hold until the first reference or goal arrives on the topic "
        "of this name",
    )
    start_s: float = parameter(0.0, "time at rest before the motion", unit="s", ge=0.0)
    duration_s: float = parameter(2.0, "time of motion, ramps included; of goals that say none", unit="s", gt=0.0)
    displacement: Three = parameter((0.0, 0.0, 0.0), "quintic: displacement from the start", unit="m")
    of: Literal["pad", "object"] = parameter(
        "pad", "what moves so: the pad, or the object's centre of mass, with the pad on it where it was grasped"
    )
    rotation: Three = parameter(
        (0.0, 0.0, 0.0), "quintic: rotation vector; circle and lemniscate: its amplitude", unit="rad"
    )
    waypoints: tuple[float, ...] = parameter(
        (), "waypoints: x y z rx ry rz per point, without the start; reached evenly over duration_s", unit="m, rad"
    )
    plane: Literal["xy", "yz", "zx"] = parameter(
        "xy", "circle, lemniscate: plane on world axes; the motion starts along the first axis"
    )
    radius: float = parameter(0.1, "circle, lemniscate: radius, half length", unit="m", gt=0.0)
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


class ControllerParams(ArmParams):
    """All parameters of one arm of the controller."""

    controller: Literal["vic", "printed", "classical"] = parameter(
        "vic",
        "vic: where joint state or slip are estimated, the authority of the compensation is bounded; printed: it is "
        "not; classical: the same law, slip activation and fading off",
    )
    mode: Literal["lockstep", "realtime"] = parameter(
        "lockstep", "lockstep waits for all samples of a stamp; realtime answers each joint state with the newest ones"
    )
    control_period_s: float = parameter(0.001, "control period", unit="s", ge=1e-5, le=1.0)
    attitude: Literal["log", "rpy"] = parameter("log", "coordinates of the orientation error")
    object: ObjectParams = Field(default_factory=ObjectParams)
    contacts: ContactParams = Field(default_factory=ContactParams)
    gains: GainParams = Field(default_factory=GainParams)
    slip_input: SlipInput = SLIP_INPUT
    slip_delay_s: float = parameter(
        0.0, "time by which the stamps of the slip input are later than the measurement", unit="s", ge=0.0
    )
    slip_estimator: Literal["measured", "observer"] = parameter(
        "measured", "slip velocity of the law: newest sample (the printed law), or observer"
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
        "hold", "where a hand pulls at the object at the end of a governed path: hold it; follow, and stay where the "
        "hand lets go; open the grip (grip.control follow)",
    )  # fmt: skip
    governor: GovernorParams = Field(default_factory=GovernorParams)
    nullspace: NullspaceParams = Field(default_factory=NullspaceParams)
    singularity: SingularityParams = Field(default_factory=SingularityParams)
    safety: SafetyParams = Field(default_factory=SafetyParams)
    trajectory: TrajectoryParams = Field(default_factory=TrajectoryParams)

    @model_validator(mode="after")
    def _grip_follows_a_governed_path(self) -> ControllerParams:
        if self.grip.control == "follow":
            if self.governor.mode == "off":
                raise ValueError("grip.control follow needs a path that is looked ahead on: set governor.mode")
            if self.grip.cap < self.grip.nominal_force:
                raise ValueError(f"grip.cap {self.grip.cap} must not be below grip.nominal_force")
        elif self.handover == "open":
            raise ValueError("handover open needs a grip that is commanded: set grip.control follow")
        return self

    @property
    def drive_lag_s(self) -> float:
        """Time from a command to the motion that it asks for: dead time, and the lag of the drives [s]."""
        own_loop = self.command.interface != "effort"
        return self.drive.delay_s + (1.0 / self.drive.bandwidth if own_loop else self.drive.lag_s)

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
