"""Where the page's scripts come from: three.js is in trimesh's wheel, uPlot in uplot-python's; none is imported.

Measured against other packages: docs/architecture.md, "Decisions".
"""

from __future__ import annotations

import importlib.util
import re
import zipfile
from pathlib import Path
from typing import Final

from slip_core.errors import InputError

_VIEWER: Final = ("trimesh", "resources/templates/viewer.zip", "viewer.html.template")
_UPLOT: Final = ("uplot", "static/uPlot.iife.js", "static/uPlot.min.css")
_THREE: Final = re.compile(r"/\*\*\s+\* @license\s+\* Copyright [\d-]+ Three\.js Authors[^/]*\*/\n!function[^\n]+")
"""Licence and module, which is one line; viewer, loader and controls of trimesh's own page follow it."""


def three() -> str:
    """Return three.js as a script that defines `THREE`.

    Raises:
        InputError: where the package is absent, or no longer holds it.
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
        InputError: where the package is absent, or no longer holds them.
    """
    package, *files = _UPLOT
    try:
        script, style = ((_folder(package) / file).read_text(encoding="utf-8") for file in files)
    except OSError as error:
        raise _other_version("uplot-python", str(error)) from None
    return script, style


def _folder(package: str) -> Path:
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        raise InputError(f"package {package}", got="not installed", expected="the packages of requirements.lock")
    return Path(spec.origin).parent


def _other_version(package: str, got: str) -> InputError:
    return InputError(f"script in package {package}", got=got, expected="the version in requirements.lock")
