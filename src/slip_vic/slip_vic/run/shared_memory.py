"""Shared-memory files that a killed DDS process leaves behind.

Those of ports stay: their names are the same in every run, and a node that starts takes over a dead port by its name.
Whoever removed one could take it from the node that has just opened it, which then hears nobody.
"""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import psutil

SHM = Path("/dev/shm")
STARTS_S = 0.1
PATTERNS = ("fastrtps_*", "fast_datasharing_*")
PORT = "fastrtps_port"


def segments() -> set[Path]:
    """Return the Fast DDS files that are there now, without those of ports."""
    if not SHM.is_dir():
        return set()
    return {path for pattern in PATTERNS for path in SHM.glob(pattern) if not path.name.startswith(PORT)}


def orphans(candidates: set[Path]) -> set[Path]:
    """Return those of `candidates` that are still there and that no process maps or holds open."""
    left = candidates & segments()
    if not left:
        return set()
    used: set[str] = set()
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            maps = Path(f"/proc/{process.pid}/maps").read_text()
            used.update(line.rsplit(maxsplit=1)[-1] for line in maps.splitlines())
            used.update(file.path for file in process.open_files())
    return {path for path in left if str(path) not in used}


def remove_orphans(candidates: set[Path]) -> set[Path]:
    """Remove the orphans among `candidates`; return what was removed."""
    found = orphans(candidates)
    if found:  # a process that starts makes a file a moment before it maps it
        time.sleep(STARTS_S)
        found = orphans(found)
    for path in found:
        path.unlink(missing_ok=True)
    return found
