"""Shared-memory files that a killed DDS process leaves behind."""

from __future__ import annotations

import contextlib
import time
from pathlib import Path

import psutil

SHM = Path("/dev/shm")
STARTS_S = 0.1
PATTERNS = ("fastrtps_*", "sem.fastrtps_*", "fast_datasharing_*")


def segments() -> set[Path]:
    """Return the Fast DDS files that are there now."""
    return {path for pattern in PATTERNS for path in SHM.glob(pattern)} if SHM.is_dir() else set()


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
    unused = {path for path in left if str(path) not in used}
    # A port's semaphore is mapped only for a moment at a time: it lives as long as the port, and ends with it.
    alive = segments() - unused
    return {path for path in unused if not (path.name.startswith("sem.") and _port_of(path) in alive)}


def _port_of(semaphore: Path) -> Path:
    return SHM / semaphore.name.removeprefix("sem.").removesuffix("_mutex")


def remove_orphans(candidates: set[Path]) -> set[Path]:
    """Remove the orphans among `candidates`; return what was removed."""
    found = orphans(candidates)
    if found:  # a process that starts makes a file a moment before it maps it
        time.sleep(STARTS_S)
        found = orphans(found)
    for path in found:
        path.unlink(missing_ok=True)
    return found
