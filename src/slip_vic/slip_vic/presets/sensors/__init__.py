"""Named sensors: the YAML files beside this one, each with the controller settings that suit it."""

from __future__ import annotations

import importlib.resources
from pathlib import Path
from typing import Any

from pydantic import Field

from slip_core.errors import InputError, nearest
from slip_core.files.plain_yaml import read_yaml
from slip_core.params import ParameterModel, load_yaml, validate
from slip_sim_bridge.sensors.params import SlipSensorParams, WrenchSensorParams

_FILES = importlib.resources.files(__name__)


class SensorPreset(ParameterModel):
    """A sensor by name: values of ``sensors.slip`` and ``sensors.wrench``, and settings of the controller."""

    description: str
    sources: str
    slip: SlipSensorParams = SlipSensorParams()
    wrench: WrenchSensorParams = WrenchSensorParams()
    controller: dict[str, Any] = Field(default_factory=dict)


def preset_names() -> list[str]:
    """Return the names of the sensors that come with the package, sorted."""
    return sorted(entry.name.removesuffix(".yaml") for entry in _FILES.iterdir() if entry.name.endswith(".yaml"))


def load_preset(name_or_path: str, text: str | None = None) -> SensorPreset:
    """Read a sensor by name or from a YAML file of the same form; with its `text` nothing is opened.

    Raises:
        InputError: unknown name (nearest offered), or a file that does not fit.
    """
    content = read_yaml(preset_text(name_or_path) if text is None else text)
    return validate(SensorPreset, content, f"sensor {name_or_path}")


def preset_text(name_or_path: str) -> str:
    """Return the YAML text of a sensor by name or from a file.

    Raises:
        InputError: unknown name (nearest offered), or a file that cannot be read.
    """
    if name_or_path in preset_names():
        return (_FILES / f"{name_or_path}.yaml").read_text(encoding="utf-8")
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml"):
        load_yaml(path)  # for its clear error
        return path.read_text(encoding="utf-8")
    raise InputError(
        f"sensor {name_or_path}",
        got="an unknown name",
        expected=nearest(name_or_path, preset_names()),
        fix="or give a .yaml file",
    )
