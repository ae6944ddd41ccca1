"""The arm's URDF and the scenario files, read through `importlib.resources` so that every kind of install works."""

from __future__ import annotations

import importlib.resources

__all__ = ["pair_names", "pair_text", "scenario_names", "scenario_text", "urdf_text"]

_FILES = importlib.resources.files(__name__)


def scenario_names() -> list[str]:
    """Return the names of the scenarios that come with the package, sorted."""
    return sorted(
        entry.name.removesuffix(".yaml") for entry in (_FILES / "scenarios").iterdir() if entry.name.endswith(".yaml")
    )


def scenario_text(name: str) -> str:
    """Return the YAML text of one scenario.

    Raises:
        KeyError: where `name` is not one of `scenario_names()`.
    """
    if name not in scenario_names():
        raise KeyError(name)
    return (_FILES / "scenarios" / f"{name}.yaml").read_text(encoding="utf-8")


def pair_names() -> list[str]:
    """Return the names of the scenarios with two arms, sorted."""
    entries = (_FILES / "scenarios" / "pairs").iterdir()
    return sorted(entry.name.removesuffix(".yaml") for entry in entries if entry.name.endswith(".yaml"))


def pair_text(name: str) -> str:
    """Return the YAML text of one scenario with two arms.

    Raises:
        KeyError: where `name` is not one of `pair_names()`.
    """
    if name not in pair_names():
        raise KeyError(name)
    return (_FILES / "scenarios" / "pairs" / f"{name}.yaml").read_text(encoding="utf-8")


def urdf_text() -> str:
    """Return the URDF of the arm with its gripper; its header comment names the sources of all numbers."""
    return (_FILES / "urdf" / "arm.urdf").read_text(encoding="utf-8")
