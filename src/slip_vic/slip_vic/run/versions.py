"""What runs on this machine: versions of the libraries and digests of our own sources, on which numbers depend."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import importlib.util
import platform
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

_GIT_TIMEOUT_S: Final = 5.0
LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "pin", "mujoco", "pydantic")
"""Distributions on which the numbers of a row can depend."""

SOURCES = (
    "slip_core",
    "slip_vic_controller",
    "slip_sim_bridge",
    "slip_vic/run",
    "slip_vic/scenarios/scenario.py",
    "slip_vic/experiments/world.py",
    "slip_vic/experiments/run.py",
    "slip_vic/experiments/driven.py",
    "slip_vic/experiments/ours.py",
)
"""Our own packages and files on which they depend; scenario, sensor and URDF are compared as texts."""


@functools.cache
def versions() -> Mapping[str, str]:
    """Return what runs here: Python, libraries by version, our own packages by a digest of their sources."""
    found = {"python": platform.python_version()}
    found |= {name: importlib.metadata.version(name) for name in LIBRARIES}
    for source in SOURCES:
        package, _, inner = source.partition("/")
        spec = importlib.util.find_spec(package)
        assert spec is not None
        assert spec.origin is not None
        path = Path(spec.origin).parent / inner
        files = sorted(path.rglob("*.py")) if path.is_dir() else [path]
        found[source] = digest(
            part for file in files for part in (file.relative_to(path.parent).as_posix().encode(), file.read_bytes())
        )
    return found


def git_revision() -> str:
    """Return the commit this code runs from, with ``+changes`` where the tree differs, "" outside a repository."""
    command = ("git", "describe", "--always", "--abbrev=40", "--exclude=*", "--dirty=+changes")
    try:
        done = subprocess.run(
            command, cwd=Path(__file__).parent, capture_output=True, text=True, timeout=_GIT_TIMEOUT_S, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return done.stdout.strip()


def digest(parts: Iterable[bytes]) -> str:
    """Return a short name of some bytes."""
    sha = hashlib.sha256()
    for part in parts:
        sha.update(len(part).to_bytes(8, "big") + part)
    return sha.hexdigest()[:16]
