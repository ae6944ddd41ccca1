"""Every parameter of the bridge, declared once: defaults, units, bounds and cross checks."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from slip_core.device_params import EACH, SLIP_INPUT, CommandInterface, DriveModel, GripperModel, NotNegative, SlipInput
from slip_core.grasp_params import ArmParams, BaseParams, ContactParams, ObjectParams, Six
from slip_core.params import ParameterModel, parameter
from slip_core.stamps import NS_PER_S
from slip_sim_bridge.friction.params import FrictionParams
from slip_sim_bridge.sensors.params import SensorsParams

HOLD_STIFFNESS = 400.0
"""[1/s2] Joint stiffness over joint inertia while the arm holds: square of the natural frequency of the loop, which is
critically damped."""

Positive = Annotated[float, Field(gt=0.0)]

WORLD = (
    "plant", "substeps", "gravity", "control_period_s", "object", "duration_s", "mode", "expected_subscribers",
)  # fmt: skip
"""Parameters that are equal for all arms: there is one world and one object."""


class DriveParams(DriveModel):
    """Simulated drives; the defaults are ideal: they do exactly what is commanded."""

    interface: CommandInterface = parameter(
        "effort", "command interface: effort [N m], or velocity [rad/s] or position [rad] with a loop in the drive"
    )
    viscous: tuple[NotNegative, ...] = parameter((), f"viscous friction of the joints; {EACH}", unit="N m s/rad")
    offset: tuple[float, ...] = parameter(
        (), f"interface effort: constant added to the effort at the joint; {EACH}", unit="N m"
    )
    gain: float = parameter(1.0, "interface effort: effort at the joint over commanded effort", ge=0.1, le=10.0)
    ripple: float = parameter(
        0.0, "interface effort: amplitude of a torque ripple, sin(6 q)",
        unit="N m", ge=0.0,
    )  # fmt: skip


class GripParams(GripperModel):
    """The gripper's squeeze."""

    force: float = parameter(
        0.5,
        "normal force N in the friction limit F = mu N: sum over both pads (twice the jaw force)",
        unit="N",
        runtime=True,
        ge=0.0,
    )
    quantum: float = parameter(0.0, "step of the force; 0 = continuous", unit="N", ge=0.0)
    hysteresis: float = parameter(
        0.0, "friction of the fingers: the force changes only when the command differs from it by more than this",
        unit="N", ge=0.0,
    )  # fmt: skip
    pad_size: tuple[Positive, Positive] = parameter(
        (0.2, 0.2), "size of the pad along its x and y: an object that slides over the edge is lost and falls", unit="m"
    )


class PushParams(ParameterModel):
    """A hand that leans on the simulated arm: to try what a person tries on a real one. Nothing by default."""

    wrench: Six = parameter(
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        "force and torque of a person's hand on the object at this arm's grasp, on world axes",
        unit="N, N m",
        runtime=True,
    )
    effort: tuple[float, ...] = parameter(
        (), "effort of a person's hand on each joint; empty = none", unit="N m", runtime=True
    )


class PadParams(ParameterModel):
    """Elasticity of a gripper's pads, from the gripper to the surface that touches the object; plant elastic only."""

    stiffness: tuple[Positive, Positive, Positive, Positive, Positive, Positive] = parameter(
        (1.0e4, 1.0e4, 1.0e4, 5.0, 5.0, 2.25), "along x y z of the pad, then about them", unit="N/m, N m/rad"
    )
    damping: tuple[Positive, Positive, Positive, Positive, Positive, Positive] = parameter(
        (30.0, 30.0, 30.0, 0.05, 0.05, 0.02), "along x y z of the pad, then about them", unit="N s/m, N m s/rad"
    )


class DisplayParams(ParameterModel):
    """How the object is drawn; nothing here changes a result."""

    object_size: tuple[Positive, Positive, Positive] = parameter(
        (0.18, 0.14, 0.014),
        "size of the box drawn for the object, centred on its centre of mass, on object axes",
        unit="m",
    )


class BridgeParams(ArmParams):
    """Everything that is configured of one arm in the bridge: the simulation, and how the node runs."""

    base: BaseParams = BaseParams()
    object: ObjectParams = ObjectParams()
    contacts: ContactParams = ContactParams()
    display: DisplayParams = DisplayParams()
    initial_position: tuple[float, ...] = parameter(
        (-0.6, -0.6, 0.4, -2.3, 1.6, 1.6, -0.8), "joint positions at the start and after a reset", unit="rad"
    )
    control_period_s: float = parameter(0.001, "time from one command to the next", unit="s", gt=0.0, le=0.02)
    effort_rate: float = parameter(
        1000.0, "largest rate of change of a joint's effort that the drives follow", unit="N m/s", gt=0.0
    )
    seed: int = parameter(0, "seed of all sensor noise; with several arms, arm k uses seed + k", ge=0)
    mode: Literal["lockstep", "realtime"] = parameter(
        "lockstep", "lockstep: wait for the command of each stamp; realtime: paced by the wall clock"
    )
    slip_input: SlipInput = SLIP_INPUT
    plant: Literal["rigid", "elastic"] = parameter(
        "rigid",
        "rigid: one arm, the object slides in the pad plane only; elastic: pads with stiffness, any number of arms",
    )  # fmt: skip
    substeps: int = parameter(
        0, "simulation steps per control period; 0 = as many as the friction law needs", ge=0, le=64
    )
    drive: DriveParams = DriveParams()
    grip: GripParams = GripParams()
    pad: PadParams = PadParams()
    push: PushParams = PushParams()
    friction: FrictionParams = FrictionParams()
    sensors: SensorsParams = SensorsParams()
    expected_subscribers: int = parameter(
        1,
        "subscribers to wait for on `joint_states` before time starts (controller, recorder if used); 0 = start at "
        "once (realtime only)",
        ge=0,
    )
    peer_timeout_s: float = parameter(
        180.0, "how long to wait for the other nodes; compiling takes over a minute", unit="s", gt=0.0
    )
    lockstep_timeout_s: float = parameter(60.0, "longest wait for the command of a lockstep tick", unit="s", gt=0.0)
    command_timeout_s: float = parameter(
        0.03,
        "largest age of the last command, from the stamp of the state it answers; beyond it the arm holds its posture",
        unit="s",
        gt=0.0,
    )
    duration_s: float = parameter(8.0, "simulated time of a run", unit="s", gt=0.0)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if len(self.initial_position) != len(self.joint_names):
            raise ValueError(
                f"initial_position: {len(self.initial_position)} numbers for {len(self.joint_names)} joints"
            )
        if len(self.push.effort) not in (0, len(self.joint_names)):
            raise ValueError(f"push.effort: {len(self.push.effort)} numbers for {len(self.joint_names)} joints")
        self.drive.check(len(self.joint_names))
        if self.sensors.slip.sees_pads and (self.plant != "elastic" or self.slip_input == "displacement"):
            raise ValueError("sensors.slip.sees_pads: needs plant elastic, and slip_input twist or flag")
        ticks = self.control_period_s * NS_PER_S
        if abs(ticks - round(ticks)) > 1e-3:
            raise ValueError("control_period_s must be a whole number of nanoseconds")
        return self


def object_urdf(params: BridgeParams) -> str:
    """Return the object as a URDF of one link, `object`, in its display size: for RViz, Foxglove and rerun."""
    x, y, z = params.display.object_size
    ixx, iyy, izz, ixy, ixz, iyz = params.object.inertia
    return f"""<?xml version="1.0"?>
<robot name="object">
  <link name="object">
    <inertial>
      <mass value="{params.object.mass!r}"/>
      <inertia ixx="{ixx!r}" iyy="{iyy!r}" izz="{izz!r}" ixy="{ixy!r}" ixz="{ixz!r}" iyz="{iyz!r}"/>
    </inertial>
    <visual>
      <geometry><box size="{x!r} {y!r} {z!r}"/></geometry>
      <material name="object"><color rgba="0.91 0.86 0.75 1"/></material>
    </visual>
  </link>
</robot>
"""
