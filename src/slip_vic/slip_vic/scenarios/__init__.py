"""Scenarios: the YAML files beside this one, and what makes parameters of them."""

from __future__ import annotations

from slip_core.files.plain_yaml import read_yaml
from slip_vic.presets import preset_names, preset_text


def scenario_names(arms: int = 0) -> list[str]:
    """Return the names of the scenarios that come with the package, sorted.

    Args:
        arms: only those with so many arms; 0: all.
    """
    return [name for name in preset_names("scenarios") if not arms or arms == number_of_arms(scenario_text(name))]


def scenario_text(name_or_path: str) -> str:
    """Return the YAML text of a scenario by name or from a file.

    Raises:
        InputError: unknown name (nearest offered), or a file that cannot be read.
    """
    return preset_text("scenarios", name_or_path)


def number_of_arms(text: str) -> int:
    """Return how many arms a scenario has, from its text."""
    return len(read_yaml(text).get("arms") or [text])
