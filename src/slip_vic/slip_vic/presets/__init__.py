"""Named parts of a robot: slip sensors, each a YAML file with the settings that suit it.

Names and texts are read here without anything heavy, so that a mistyped name is answered at once.
"""

from __future__ import annotations

import importlib.resources
from pathlib import Path

from slip_core.errors import UnknownName

_FILES = importlib.resources.files(__name__)


def preset_names(kind: str) -> list[str]:
    """Return the names of the presets of a kind that come with the package, sorted; kind: a folder beside this file."""
    entries = (_FILES / kind).iterdir()
    return sorted(entry.name.removesuffix(".yaml") for entry in entries if entry.name.endswith(".yaml"))


def find_preset(kind: str, name_or_path: str) -> Path | None:
    """Return the file that a preset is in, None where it comes with the package.

    Raises:
        UnknownName: of no preset (the nearest are offered).
    """
    if name_or_path in preset_names(kind):
        return None
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml"):
        return path
    raise UnknownName(kind.removesuffix("s"), name_or_path, preset_names(kind), fix="(or a .yaml file)")


def preset_text(kind: str, name_or_path: str) -> str:
    """Return the YAML text of a preset by name or from a file.

    Raises:
        InputError: unknown name (nearest offered), or a file that cannot be read.
    """
    path = find_preset(kind, name_or_path)
    if path is None:
        return (_FILES / kind / f"{name_or_path}.yaml").read_text(encoding="utf-8")
    from slip_core.params import load_yaml

    load_yaml(path)  # for its clear error
    return path.read_text(encoding="utf-8")
