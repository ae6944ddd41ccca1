"""What a preset's file holds: slip sensor, drives or gripper, with the controller settings that suit it."""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import Field

from slip_core.params import ParameterModel, parse_mapping, validate
from slip_sim_bridge.drives.params import DriveParams
from slip_sim_bridge.sensors.params import JointSensorParams, SlipSensorParams, WrenchSensorParams
from slip_vic.presets import preset_text


class Preset(ParameterModel):
    """A part of a robot by name; controller: the settings that suit it."""

    description: str
    sources: str
    controller: dict[str, Any] = Field(default_factory=dict)


class SensorPreset(Preset):
    """A slip sensor: values of ``sensors.slip`` and ``sensors.wrench``."""

    slip: SlipSensorParams = SlipSensorParams()
    wrench: WrenchSensorParams = WrenchSensorParams()


class DrivePreset(Preset):
    """Drives with the encoders that belong to them: values of ``drive`` and ``sensors.joint``.

    Lists begin at the base: an arm with fewer joints has the first numbers, one with more repeats the last. period_s:
    control period of both nodes, where the drives take commands no faster [s].
    """

    period_s: float | None = None

    drive: DriveParams = DriveParams()
    joint: JointSensorParams = JointSensorParams()


class GripperPreset(Preset):
    """A gripper: values of ``grip``; forces are the sum over both pads."""

    grip: dict[str, float] = Field(default_factory=dict)


Kind = TypeVar("Kind", bound=Preset)


def load_sensor(name_or_path: str) -> SensorPreset:
    """Read a sensor by name or from a YAML file of the same form.

    Raises:
        InputError: unknown name (nearest offered), or a file that does not fit.
    """
    return _load(SensorPreset, "sensor", name_or_path)


def load_drive(name_or_path: str) -> DrivePreset:
    """Read drives by name or from a YAML file, as `load_sensor` does."""
    return _load(DrivePreset, "drive", name_or_path)


def load_gripper(name_or_path: str) -> GripperPreset:
    """Read a gripper by name or from a YAML file, as `load_sensor` does."""
    return _load(GripperPreset, "gripper", name_or_path)


def _load(model: type[Kind], kind: str, name_or_path: str) -> Kind:
    origin = f"{kind} {name_or_path}"
    return validate(model, parse_mapping(preset_text(f"{kind}s", name_or_path), origin), origin)
