"""Named sensors: the YAML files beside this one, each with the controller settings that suit it."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from slip_core.files.plain_yaml import read_yaml
from slip_core.params import ParameterModel, validate
from slip_sim_bridge.sensors.params import SlipSensorParams, WrenchSensorParams
from slip_vic.presets import preset_text


class SensorPreset(ParameterModel):
    """A sensor by name: values of ``sensors.slip`` and ``sensors.wrench``, and settings of the controller."""

    description: str
    sources: str
    slip: SlipSensorParams = SlipSensorParams()
    wrench: WrenchSensorParams = WrenchSensorParams()
    controller: dict[str, Any] = Field(default_factory=dict)


def load_sensor(name_or_path: str, text: str | None = None) -> SensorPreset:
    """Read a sensor by name or from a YAML file of the same form; with its `text` nothing is opened.

    Raises:
        InputError: unknown name (nearest offered), or a file that does not fit.
    """
    content = read_yaml(preset_text("sensors", name_or_path) if text is None else text)
    return validate(SensorPreset, content, f"sensor {name_or_path}")
