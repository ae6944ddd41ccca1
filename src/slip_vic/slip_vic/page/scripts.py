"""The page's libraries: three.js out of trimesh's wheel, and uPlot, which stands beside the page's own scripts."""

from __future__ import annotations

import importlib.resources
import importlib.util
import re
import zipfile
from pathlib import Path
from typing import Final

from slip_core.errors import InputError

STATIC: Final = importlib.resources.files(__package__) / "static"
_VIEWER: Final = ("trimesh", "resources/templates/viewer.zip", "viewer.html.template")
_THREE: Final = re.compile(r"/\*\*\s+\* @license\s+\* Copyright [\d-]+ Three\.js Authors[^/]*\*/\n!function[^\n]+")
"""Licence and module, which is one line; viewer, loader and controls of trimesh's own page follow it."""


def three() -> str:
    """Return three.js as a script that defines `THREE`; trimesh is not imported.

    Raises:
        InputError: where the package is absent, or no longer holds it.
    """
    package, archive, member = _VIEWER
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        raise InputError(f"package {package}", got="not installed", expected="the packages of requirements.lock")
    path = Path(spec.origin).parent / archive
    try:
        with zipfile.ZipFile(path) as opened:
            found = _THREE.search(opened.read(member).decode("utf-8"))
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise _other_version(package, str(error)) from None
    if found is None:
        raise _other_version(package, f"no three.js in {path.name}")
    return found[0]


def uplot() -> tuple[str, str]:
    """Return uPlot's script, which defines `uPlot`, and its style."""
    return read_static("uPlot.iife.min.js"), read_static("uPlot.min.css")


def read_static(name: str) -> str:
    """Return the text of a file beside the page."""
    return (STATIC / name).read_text(encoding="utf-8")


def _other_version(package: str, got: str) -> InputError:
    return InputError(f"script in package {package}", got=got, expected="the version in requirements.lock")
