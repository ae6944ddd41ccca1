"""Scenarios: the YAML files beside this one, and what makes parameters of them."""

from __future__ import annotations

from slip_core.files.plain_yaml import read_yaml
from slip_vic.presets import preset_names, preset_text


def scenario_names(arms: int = 0) -> list[str]:
    """Return the names of the scenarios that come with the package, sorted.

    Args:
        arms: only those with so many arms; 0: all.
    """
    return [
        name
        for name in preset_names("scenarios")
        if not arms or arms == len(read_yaml(preset_text("scenarios", name)).get("arms") or [name])
    ]
