"""The page's libraries: three.js in the wheel of trimesh, uPlot in that of uplot-python, which is not imported."""

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
_UPLOT: Final = ("uplot", "static/uPlot.iife.js", "static/uPlot.min.css")
_THREE: Final = re.compile(r"/\*\*\s+\* @license\s+\* Copyright [\d-]+ Three\.js Authors[^/]*\*/\n!function[^\n]+")
"""Licence and module, which is one line; viewer, loader and controls of trimesh's own page follow it."""


def three() -> str:
    """Return three.js as a script that defines `THREE`.

    Raises:
        InputError: the package is absent, or its version does not hold it.
    """
    package, archive, member = _VIEWER
    path = _folder(package) / archive
    try:
        with zipfile.ZipFile(path) as opened:
            found = _THREE.search(opened.read(member).decode("utf-8"))
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise _other_version(package, str(error)) from None
    if found is None:
        raise _other_version(package, f"no three.js in {path.name}")
    return found[0]


def uplot() -> tuple[str, str]:
    """Return uPlot's script, which defines `uPlot`, and its style.

    Raises:
        InputError: the package is absent, or its version does not hold them.
    """
    package, *files = _UPLOT
    try:
        script, style = ((_folder(package) / file).read_text(encoding="utf-8") for file in files)
    except OSError as error:
        raise _other_version("uplot-python", str(error)) from None
    return script, style


def read_static(name: str) -> str:
    """Return the text of a file beside the page."""
    return (STATIC / name).read_text(encoding="utf-8")


def _folder(package: str) -> Path:
    spec = importlib.util.find_spec(package)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).parent


def _other_version(package: str, got: str) -> InputError:
    return InputError(f"script in package {package}", got=got, expected="the version in requirements.lock")
