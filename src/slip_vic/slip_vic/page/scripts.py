"""The page's libraries: three.js in the wheel of trimesh, uPlot in that of uplot-python, which is not imported."""

from __future__ import annotations

import contextlib
import importlib.resources
import importlib.util
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from slip_core.errors import InputError

STATIC: Final = importlib.resources.files(__package__) / "static"
_THREE: Final = re.compile(r"/\*\*\s+\* @license\s+\* Copyright [\d-]+ Three\.js Authors[^/]*\*/\n!function[^\n]+")
"""Licence and module, which is one line; viewer, loader and controls of trimesh's own page follow it."""


def three() -> str:
    """Return three.js as a script that defines `THREE`.

    Raises:
        InputError: the package's version does not hold it.
    """
    with _folder("trimesh") as folder, zipfile.ZipFile(folder / "resources/templates/viewer.zip") as opened:
        found = _THREE.search(opened.read("viewer.html.template").decode("utf-8"))
        if found is None:
            raise KeyError("no three.js in viewer.zip")
        return found[0]


def uplot() -> tuple[str, str]:
    """Return uPlot's script, which defines `uPlot`, and its style.

    Raises:
        InputError: the package's version does not hold them.
    """
    with _folder("uplot") as folder:
        script, style = ((folder / "static" / name).read_text("utf-8") for name in ("uPlot.iife.js", "uPlot.min.css"))
        return script, style


def read_static(name: str) -> str:
    """Return the text of a file beside the page."""
    return (STATIC / name).read_text(encoding="utf-8")


@contextlib.contextmanager
def _folder(package: str) -> Iterator[Path]:
    """Give the folder of a package, which is not imported; what is missing in it is the fault of its version."""
    spec = importlib.util.find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    try:
        yield Path(spec.origin).parent
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(
            f"script in package {package}", got=str(error), expected="the version in requirements.lock"
        ) from None
