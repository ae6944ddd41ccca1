"""Find files by ``package://`` URI or path, whether installed, editable or in a colcon overlay."""

from __future__ import annotations

import importlib.resources
from pathlib import Path

from slip_core.errors import InputError


def read_text(uri: str, what: str) -> str:
    """Return the text behind ``package://<python package>/<path>`` or a plain path.

    Raises:
        InputError: where the package or the file does not exist or cannot be read.
    """
    try:
        if uri.startswith("package://"):
            package, _, inner = uri.removeprefix("package://").partition("/")
            return importlib.resources.files(package).joinpath(inner).read_text(encoding="utf-8")
        return Path(uri).read_text(encoding="utf-8")
    except (OSError, ModuleNotFoundError, UnicodeDecodeError, ValueError) as error:
        raise InputError(what, got=uri, expected="a readable file", fix=str(error)) from None
