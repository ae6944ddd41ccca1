"""Named drives: the YAML files beside this one, each with the encoders that belong to them."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from slip_core.files.plain_yaml import read_yaml
from slip_core.params import ParameterModel, validate
from slip_sim_bridge.drives.params import DriveParams
from slip_sim_bridge.sensors.params import JointSensorParams
from slip_vic.presets import preset_text


class DrivePreset(ParameterModel):
    """Drives by name: values of ``drive`` and ``sensors.joint``, and the controller parameters that suit them.

    Lists begin at the base: an arm with fewer joints has the first numbers, one with more repeats the last.
    """

    description: str
    sources: str
    drive: DriveParams = DriveParams()
    joint: JointSensorParams = JointSensorParams()
    controller: dict[str, Any] = Field(default_factory=dict)


def load_drive(name_or_path: str, text: str | None = None) -> DrivePreset:
    """Read drives by name or from a YAML file of the same form; with its `text` nothing is opened.

    Raises:
        InputError: unknown name (nearest offered), or a file that does not fit.
    """
    content = read_yaml(preset_text("drives", name_or_path) if text is None else text)
    return validate(DrivePreset, content, f"drive {name_or_path}")
