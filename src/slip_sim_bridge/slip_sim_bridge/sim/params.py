"""Every parameter of the simulator, declared once: defaults, units, bounds and cross checks."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator

from slip_core.arrays import inertia_from_six
from slip_core.params import ParameterModel, parameter
from slip_sim_bridge.sim.sensor_params import SensorsParams

_CLOCK_TICKS_PER_S = 1_000_000_000


class ObjectParams(ParameterModel):
    """The grasped rigid body."""

    mass: float = parameter(0.5, "mass of the object", unit="kg", gt=0.0)
    inertia: tuple[float, float, float, float, float, float] = parameter(
        (2.0e-3, 2.0e-3, 2.0e-3, 0.0, 0.0, 0.0),
        "inertia ixx, iyy, izz, ixy, ixz, iyz about the centre of mass on the object's axes",
        unit="kg m2",
    )

    @model_validator(mode="after")
    def _physical(self) -> Self:
        inertia_from_six(self.inertia, "object.inertia")
        return self


class ContactsParams(ParameterModel):
    """The grasps, in object coordinates; contact 0 is the one that is simulated."""

    position: tuple[float, ...] = parameter(
        (0.02, 0.0, 0.0), "pad centre minus centre of mass on object axes when grasped, 3 numbers per contact", unit="m"
    )
    orientation_xyzw: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0, 1.0), "orientation of the pad frame on object axes when grasped, 4 numbers per contact"
    )
    slip_axes: tuple[bool, ...] = parameter(
        (True, True, False, False, False, True), "pad directions in which a contact can slip, 6 per contact"
    )

    @model_validator(mode="after")
    def _same_count(self) -> Self:
        count = len(self.position) // 3
        if count < 1 or len(self.position) != 3 * count:
            raise ValueError(f"contacts.position needs 3 numbers per contact, got {len(self.position)}")
        if len(self.orientation_xyzw) != 4 * count:
            raise ValueError(f"contacts.orientation_xyzw needs {4 * count} numbers, got {len(self.orientation_xyzw)}")
        if len(self.slip_axes) != 6 * count:
            raise ValueError(f"contacts.slip_axes needs {6 * count} values, got {len(self.slip_axes)}")
        if any(abs(sum(x * x for x in self.orientation_xyzw[4 * i : 4 * i + 4]) - 1.0) > 1e-3 for i in range(count)):
            raise ValueError("contacts.orientation_xyzw needs unit quaternions (x, y, z, w)")
        return self


class GripParams(ParameterModel):
    """The gripper's squeeze."""

    force: float = parameter(
        0.5,
        "normal force N of the friction limit F = mu N: the sum over both pads (twice the jaw force)",
        unit="N",
        runtime=True,
        ge=0.0,
    )


class LugreParams(ParameterModel):
    """Bristles of the elasto-plastic LuGre model."""

    stiffness: float = parameter(1.0e5, "bristle stiffness sigma_0", unit="N/m", gt=0.0)
    damping: float = parameter(50.0, "bristle damping sigma_1", unit="N s/m", ge=0.0)
    breakaway_fraction: float = parameter(
        0.95, "share of the static limit up to which the bristles are purely elastic", ge=0.0, lt=1.0
    )


class FrictionParams(ParameterModel):
    """Friction between pads and object on an ellipsoidal limit surface."""

    model: Literal["stribeck", "coulomb", "lugre"] = parameter("stribeck", "friction model; coulomb uses mu_k only")
    mu_s: float = parameter(0.5, "static friction coefficient", ge=0.0)
    mu_k: float = parameter(0.4, "kinetic friction coefficient", ge=0.0)
    stribeck_velocity: float = parameter(
        0.05, "speed at which friction has fallen to the kinetic level", unit="m/s", gt=0
    )
    viscous: float = parameter(0.05, "friction force per slip speed, added to mu N", unit="N s/m", ge=0.0)
    torsional_radius: float = parameter(0.03, "largest friction torque over largest friction force", unit="m", gt=0.0)
    lugre: LugreParams = LugreParams()

    @model_validator(mode="after")
    def _static_above_kinetic(self) -> Self:
        if self.mu_s < self.mu_k:
            raise ValueError(f"friction.mu_s {self.mu_s} must not be below friction.mu_k {self.mu_k}")
        return self


class HoldParams(ParameterModel):
    """What the simulated arm does until a command arrives."""

    stiffness: float = parameter(
        400.0,
        "joint stiffness over joint inertia while holding: square of the loop's natural frequency",
        unit="1/s2",
        ge=0.0,
    )
    damping: float = parameter(40.0, "joint damping over joint inertia while holding", unit="1/s", ge=0.0)


class BridgeParams(ParameterModel):
    """All parameters of the simulator."""

    robot_description: str = parameter("", "URDF text of the arm; empty reads robot_description_file")
    robot_description_file: str = parameter(
        "package://slip_description/urdf/arm.urdf", "URDF of the arm: a path or package://<package>/<path>"
    )
    joint_names: tuple[str, ...] = parameter(
        tuple(f"arm_joint{i}" for i in range(1, 8)), "joints of the arm in the order of all joint vectors", min_length=1
    )
    ee_frame: str = parameter("ee", "link at the pad centre: x approach, z closing direction")
    object: ObjectParams = ObjectParams()
    contacts: ContactsParams = ContactsParams()
    gravity: tuple[float, float, float] = parameter((0.0, 0.0, -9.81), "gravity on world axes", unit="m/s2")
    initial_position: tuple[float, ...] = parameter(
        (-0.6, -0.6, 0.4, -2.3, 1.6, 1.6, -0.8), "joint positions at the start and after a reset", unit="rad"
    )
    control_period_s: float = parameter(0.001, "time from one command to the next", unit="s", gt=0.0, le=0.02)
    effort_rate: float = parameter(
        1000.0, "largest change of a joint's effort that the drives follow, whatever is commanded", unit="N m/s", gt=0.0
    )
    seed: int = parameter(0, "seed of all sensor noise", ge=0)
    mode: Literal["lockstep", "realtime"] = parameter(
        "lockstep", "lockstep waits for the command of each stamp; realtime is paced by the wall clock"
    )
    backend: Literal["implicit", "native"] = parameter(
        "implicit", "friction by limit-surface projection, or MuJoCo's own contacts as a cross check"
    )
    substeps: int = parameter(
        0, "simulation steps per control period; 0 chooses what the friction law needs", ge=0, le=64
    )
    hold: HoldParams = HoldParams()
    grip: GripParams = GripParams()
    friction: FrictionParams = FrictionParams()
    sensors: SensorsParams = SensorsParams()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if len(set(self.joint_names)) != len(self.joint_names):
            raise ValueError("joint_names must not repeat a name")
        if len(self.initial_position) != len(self.joint_names):
            raise ValueError(
                f"initial_position: {len(self.initial_position)} numbers for {len(self.joint_names)} joints"
            )
        ticks = self.control_period_s * _CLOCK_TICKS_PER_S
        if abs(ticks - round(ticks)) > 1e-3:
            raise ValueError("control_period_s must be a whole number of nanoseconds")
        return self

    @property
    def control_period_ns(self) -> int:
        """The control period on the integer clock [ns]."""
        return round(self.control_period_s * _CLOCK_TICKS_PER_S)
