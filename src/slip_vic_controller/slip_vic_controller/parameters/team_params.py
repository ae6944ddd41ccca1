"""Parameters of the node that controls two arms on one object: those of each, and where the bases stand."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from slip_core.grasp_params import BaseParams
from slip_core.params import ParameterModel
from slip_vic_controller.parameters.node_params import ControllerNodeParams

COMMON = ("mode", "control_period_s", "auto_activate", "expected_subscribers")


class TeamParams(ParameterModel):
    """Two arms; the bases are where the controller believes them to be."""

    left: ControllerNodeParams = Field(default_factory=ControllerNodeParams)
    right: ControllerNodeParams = Field(default_factory=ControllerNodeParams)
    left_base: BaseParams = Field(default_factory=BaseParams)
    right_base: BaseParams = Field(default_factory=BaseParams)

    @model_validator(mode="after")
    def _one_process(self) -> Self:
        for name in COMMON:
            if getattr(self.left, name) != getattr(self.right, name):
                raise ValueError(f"{name} of both sides must be equal: one process controls both arms")
        for side, arm in (("left", self.left), ("right", self.right)):
            if arm.trajectory.kind in ("topic", "goal"):
                raise ValueError(f"{side}.trajectory.kind {arm.trajectory.kind}: two arms follow built-in paths only")
            if arm.grip.control == "follow":
                raise ValueError(f"{side}.grip.control follow: the grip of two arms is constant")
        return self

    @property
    def arms(self) -> tuple[ControllerNodeParams, ControllerNodeParams]:
        """Both sides."""
        return self.left, self.right

    @property
    def bases(self) -> tuple[BaseParams, BaseParams]:
        """Bases of both sides."""
        return self.left_base, self.right_base
