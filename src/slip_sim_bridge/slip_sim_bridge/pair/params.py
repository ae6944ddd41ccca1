"""Parameters of the simulation with two arms: what one arm's bridge has, for each side, and what joins them."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from slip_core.grasp_params import BaseParams, Six
from slip_core.params import ParameterModel, parameter
from slip_sim_bridge.params import BridgeParams

SIDES = ("left", "right")
COMMON = ("gravity", "control_period_s", "object", "duration_s", "mode", "wait_for", "stop_after_duration")


class PadParams(ParameterModel):
    """Elasticity of a gripper's pads, from the gripper to the surface that touches the object; both grasps alike."""

    stiffness: Six = parameter(
        (1.0e4, 1.0e4, 1.0e4, 5.0, 5.0, 2.25), "along x y z of the pad, then about them", unit="N/m, N m/rad"
    )
    damping: Six = parameter(
        (30.0, 30.0, 30.0, 0.05, 0.05, 0.02), "along x y z of the pad, then about them", unit="N s/m, N m s/rad"
    )

    @model_validator(mode="after")
    def _positive(self) -> Self:
        for name in ("stiffness", "damping"):
            if min(getattr(self, name)) <= 0.0:
                raise ValueError(f"pad.{name} {list(getattr(self, name))}: every value must be positive")
        return self


class PairParams(ParameterModel):
    """Two arms, one object; what they have in common (`COMMON`) and the seed are read from `left`."""

    left: BridgeParams = Field(default_factory=BridgeParams)
    right: BridgeParams = Field(default_factory=BridgeParams)
    left_base: BaseParams = Field(default_factory=BaseParams)
    right_base: BaseParams = Field(default_factory=BaseParams)
    pad: PadParams = Field(default_factory=PadParams)

    @model_validator(mode="after")
    def _one_world(self) -> Self:
        for name in COMMON:
            if getattr(self.left, name) != getattr(self.right, name):
                raise ValueError(f"{name} of both sides must be equal: there is one world and one object")
        for side, arm in zip(SIDES, self.arms, strict=True):
            if arm.grip.control == "follow":
                raise ValueError(f"{side}.grip.control follow: the grip of two arms is constant")
            if arm.slip_input != "twist":
                raise ValueError(f"{side}.slip_input {arm.slip_input}: two arms have slip velocities")
            if any((*arm.push.wrench, *arm.push.effort)):
                raise ValueError(f"{side}.push: nobody pushes two arms")
            if arm.friction.falls_to != 1.0:
                raise ValueError(f"{side}.friction.falls_to: with two arms friction stays")
            if arm.publish_tf:
                raise ValueError(f"{side}.publish_tf: with two arms the recorder writes /tf")
        if self.left.friction.model != self.right.friction.model:
            raise ValueError("friction.model of both sides must be equal; its numbers may differ")
        return self

    @property
    def arms(self) -> tuple[BridgeParams, BridgeParams]:
        """Both sides."""
        return self.left, self.right

    @property
    def mode(self) -> str:
        """Lockstep or realtime, of both."""
        return self.left.mode

    @property
    def duration_s(self) -> float:
        """Simulated time of a run [s]."""
        return self.left.duration_s

    @property
    def seed(self) -> int:
        """Seed of the sensor noise; the right arm's sensors have the next one."""
        return self.left.seed

    @property
    def bases(self) -> tuple[BaseParams, BaseParams]:
        """Bases of both sides."""
        return self.left_base, self.right_base
