"""The command line in a process of its own, as a user's shell starts it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from slip_vic.run.processes import child_environment

DEADLINE_S = 600.0  # a hang: every command takes seconds, the demo a minute


def plain_environment(**more: str) -> dict[str, str]:
    """Return the environment of a process that no launcher started."""
    environment = child_environment(0) | more
    del environment["ROS_DOMAIN_ID"], environment["SLIP_VIC_EVENTS"]
    return environment


def slip_vic(*words: object, folder: Path | None = None) -> subprocess.CompletedProcess[str]:
    command, how = [sys.executable, "-m", "slip_vic.cli", *map(str, words)], {"cwd": folder, "timeout": DEADLINE_S}
    return subprocess.run(command, env=plain_environment(), capture_output=True, text=True, check=False, **how)
