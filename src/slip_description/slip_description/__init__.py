"""The arm's URDF, read through `importlib.resources` so that every kind of install works."""

from __future__ import annotations

import importlib.resources

__all__ = ["urdf_text"]

_FILES = importlib.resources.files(__name__)


def urdf_text() -> str:
    """Return the URDF of the arm with its gripper; its header comment names the sources of all numbers."""
    return (_FILES / "urdf" / "arm.urdf").read_text(encoding="utf-8")
