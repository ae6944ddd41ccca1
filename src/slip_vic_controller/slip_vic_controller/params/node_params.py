"""Parameters of the controller node: those of the law, and how the node runs."""

from __future__ import annotations

from pydantic import Field

from slip_core.grasp_params import BaseParams
from slip_core.params import parameter
from slip_vic_controller.params.controller_params import ControllerParams


class ControllerNodeParams(ControllerParams):
    """All parameters of the controller node."""

    expected_subscribers: int = parameter(
        1,
        "subscribers on `effort_command` before `controller/ready` is sent (bridge, and recorder where there is one)",
        ge=1,
    )
    auto_activate: bool = parameter(
        True, "configure and activate at start; false waits for the lifecycle services (a managed node)"
    )
    publish_effort_array: bool = parameter(
        False, "also publish `effort_controller/commands` (Float64MultiArray) for ros2_control's effort controllers"
    )
    base: BaseParams = Field(default_factory=BaseParams)
