"""The configuration of both nodes of the gripper: the bridge simulates it, the controller counts on it."""

from __future__ import annotations

from typing import Literal

from slip_core.params import ParameterModel, parameter


class GripperModel(ParameterModel):
    """A gripper whose force follows a command."""

    control: Literal["fixed", "follow"] = parameter(
        "fixed", "fixed: the grip stays as it is; follow: the controller commands it on `grip_command`"
    )
    lag_s: float = parameter(
        0.0, "time constant with which the grip force follows its command; 0 = at once", unit="s", ge=0.0
    )
