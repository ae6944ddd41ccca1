"""Contents of a preset file: slip sensor, drives or gripper, with matching controller settings."""

from __future__ import annotations

from typing import Any, ClassVar, TypeVar

from pydantic import Field

from slip_core.params import ParameterModel, parse_mapping, validate
from slip_sim_bridge.params import DriveParams
from slip_sim_bridge.sensors.params import JointSensorParams, SlipSensorParams, WrenchSensorParams
from slip_vic.presets import preset_text


class Preset(ParameterModel):
    """A part of a robot by name; controller: matching settings."""

    kind: ClassVar[str]
    description: str
    sources: str
    controller: dict[str, Any] = Field(default_factory=dict)


class SensorPreset(Preset):
    """A slip sensor: values of ``sensors.slip`` and ``sensors.wrench``."""

    kind = "sensor"
    slip: SlipSensorParams = SlipSensorParams()
    wrench: WrenchSensorParams = WrenchSensorParams()


class DrivePreset(Preset):
    """Drives with the encoders that belong to them: values of ``drive`` and ``sensors.joint``.

    Lists begin at the base: an arm with fewer joints has the first numbers, one with more repeats the last. period_s:
    control period of both nodes, where the drives take commands no faster [s].
    """

    kind = "drive"
    period_s: float | None = None
    drive: DriveParams = DriveParams()
    joint: JointSensorParams = JointSensorParams()


class GripperPreset(Preset):
    """A gripper: values of ``grip``; forces are the sum over both pads."""

    kind = "gripper"
    grip: dict[str, float] = Field(default_factory=dict)


Named = TypeVar("Named", bound=Preset)


def load_preset(model: type[Named], name_or_path: str) -> Named:
    """Read a preset by name or from a YAML file of the same form.

    Raises:
        InputError: unknown name (nearest offered), or a file that does not fit.
    """
    origin = f"{model.kind} {name_or_path}"
    return validate(model, parse_mapping(preset_text(f"{model.kind}s", name_or_path), origin), origin)
