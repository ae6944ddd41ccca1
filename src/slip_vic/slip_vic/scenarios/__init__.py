"""Scenarios: the YAML files beside this one, and what makes parameters of them.

Names and texts are read here without anything heavy, so that a mistyped name is answered at once.
"""

from __future__ import annotations

import importlib.resources
import re
from pathlib import Path
from typing import Final

from slip_core.errors import UnknownName

__all__ = ["find_scenario", "scenario_names", "scenario_text"]

_FILES: Final = importlib.resources.files(__name__)
_SUFFIX: Final = ".yaml"
_ARMS: Final = re.compile(r"^arms:\n((?:[ #].*\n|\n)*)", re.MULTILINE)
_ARM: Final = re.compile(r"^  \w+:", re.MULTILINE)


def scenario_names(arms: int = 0) -> list[str]:
    """Return the names of the scenarios that come with the package, sorted.

    Args:
        arms: only those with so many arms; 0: all.
    """
    names = sorted(entry.name.removesuffix(_SUFFIX) for entry in _FILES.iterdir() if entry.name.endswith(_SUFFIX))
    return [name for name in names if not arms or arms == number_of_arms(scenario_text(name))]


def scenario_text(name: str) -> str:
    """Return the YAML text of one scenario.

    Raises:
        KeyError: where `name` is not one of `scenario_names()`.
    """
    entry = _FILES / f"{name}{_SUFFIX}"
    if "/" in name or not entry.is_file():
        raise KeyError(name)
    return entry.read_text(encoding="utf-8")


def number_of_arms(text: str) -> int:
    """Return how many arms a scenario has, from its text."""
    block = _ARMS.search(text)
    return len(_ARM.findall(block[1])) if block else 1


def find_scenario(name_or_path: str) -> Path | None:
    """Return the file that a scenario is in, None where it comes with the package.

    Raises:
        UnknownName: of no scenario (the nearest are offered).
    """
    if (_FILES / f"{name_or_path}{_SUFFIX}").is_file() and "/" not in name_or_path:
        return None
    path = Path(name_or_path)
    if path.suffix in (_SUFFIX, ".yml"):
        return path
    raise UnknownName("scenario", name_or_path, scenario_names(), fix="(or a .yaml file)")
