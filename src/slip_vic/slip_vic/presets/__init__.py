"""Presets by name, or your own YAML file: scenarios, sensors, drives and grippers."""

from __future__ import annotations

import importlib.resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Final

from slip_core.errors import UnknownName
from slip_core.files.resources import read_text

_PACKAGE: Final = importlib.resources.files("slip_vic")
_SUFFIX: Final = ".yaml"


def _folder(kind: str) -> Traversable:
    return _PACKAGE / kind if kind == "scenarios" else _PACKAGE / "presets" / kind


def preset_names(kind: str) -> list[str]:
    """Return the names that come with the package, sorted; kind: scenarios, sensors, drives or grippers."""
    names = (entry.name for entry in _folder(kind).iterdir())
    return sorted(name.removesuffix(_SUFFIX) for name in names if name.endswith(_SUFFIX))


def preset_text(kind: str, name_or_path: str) -> str:
    """Return the YAML text of a preset by name or from a file.

    Raises:
        InputError: unknown name (nearest offered), or a file that cannot be read.
    """
    if name_or_path in preset_names(kind):
        return (_folder(kind) / f"{name_or_path}{_SUFFIX}").read_text(encoding="utf-8")
    if Path(name_or_path).suffix not in (_SUFFIX, ".yml"):
        raise UnknownName(kind.removesuffix("s"), name_or_path, preset_names(kind), fix="(or a .yaml file)")
    return read_text(name_or_path, f"file {name_or_path}")
