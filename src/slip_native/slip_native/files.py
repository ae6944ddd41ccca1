"""Files of an export that need no compiler: C sources, and the library that a wheel carries."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Final

SOURCES: Final = resources.files("slip_native")
CARRIED: Final = "built"
"""Folder of the package in which a wheel carries library and headers; `tools/wheel.py` writes it."""


def sources() -> dict[str, str]:
    """Return what is compiled beside the library, by its path in the folder: the example, and the node."""
    found = {name: SOURCES / "c" / name for name in ("example.c", "CMakeLists.txt")}
    found |= {f"node/{file.name}": file for file in (SOURCES / "node").iterdir()}
    return {name: file.read_text(encoding="utf-8") for name, file in found.items()}


def copy_carried(folder: Path) -> bool:
    """Copy library and headers that a wheel carries into a folder; return whether there are any."""
    found = SOURCES / CARRIED
    if not found.is_dir():
        return False
    for file in found.iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    return True
