"""Where a bag comes from: versions, machine and source revision, stored as its custom data."""

from __future__ import annotations

import json
import platform
import subprocess
from pathlib import Path
from typing import Final

_GIT_TIMEOUT_S: Final = 5.0


def provenance() -> dict[str, str]:
    """Return what identifies software and machine, each value one line of text."""
    return {
        "versions": json.dumps({"python": platform.python_version()}),
        "platform": f"{platform.system()} {platform.release()} {platform.machine()}",
        "cpu": cpu_model(),
        "git_revision": git_revision(),
    }


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


def cpu_model() -> str:
    """Return the processor's name, "" where the system does not tell."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")
