"""Shared-memory files that a killed DDS process leaves behind."""

from __future__ import annotations

import contextlib
from pathlib import Path

import psutil

SHM = Path("/dev/shm")
PATTERNS = ("fastrtps_*", "sem.fastrtps_*", "fast_datasharing_*")


def segments() -> set[Path]:
    """Return the Fast DDS files that are there now."""
    return {path for pattern in PATTERNS for path in SHM.glob(pattern)} if SHM.is_dir() else set()


def remove_orphans(candidates: set[Path]) -> set[Path]:
    """Remove those of `candidates` that no process maps or holds open; return what was removed."""
    left = candidates & segments()
    if not left:
        return set()
    used: set[str] = set()
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            used.update(
                line.rsplit(maxsplit=1)[-1] for line in Path(f"/proc/{process.pid}/maps").read_text().splitlines()
            )
            used.update(file.path for file in process.open_files())
    orphans = {path for path in left if str(path) not in used}
    for path in orphans:
        path.unlink(missing_ok=True)
    return orphans
