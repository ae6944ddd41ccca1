"""Shared-memory files that a killed DDS process leaves behind.

A port has the same name in every run, and a node that starts takes over a dead one by its name, with what is left in
it. Whoever removed one could take it from the node that has just opened it, which then hears nobody: only those of a
domain that nobody uses are removed, before the first node of a run starts in it.
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
FIRST_PORT, PORTS_PER_DOMAIN = 7400, 250  # of DDS-RTPS


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
    used = _in_use()
    return {path for path in left if str(path) not in used}


def _in_use() -> set[str]:
    """Return what any process maps or holds open."""
    used: set[str] = set()
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            maps = Path(f"/proc/{process.pid}/maps").read_text()
            used.update(line.rsplit(maxsplit=1)[-1] for line in maps.splitlines())
            used.update(file.path for file in process.open_files())
    return used


def remove_orphans(candidates: set[Path]) -> set[Path]:
    """Remove the orphans among `candidates`; return what was removed."""
    found = orphans(candidates)
    if found:  # a process that starts makes a file a moment before it maps it
        time.sleep(STARTS_S)
        found = orphans(found)
    for path in found:
        path.unlink(missing_ok=True)
    return found


def remove_dead_ports(domain: int) -> None:
    """Remove the ports of a domain that no process has open: what nodes that were killed in it left behind."""
    first = FIRST_PORT + PORTS_PER_DOMAIN * domain
    ports = [SHM / f"{PORT}{number}" for number in range(first, first + PORTS_PER_DOMAIN)]
    files = [(port, SHM / f"{port.name}_el", SHM / f"sem.{port.name}_mutex") for port in ports]
    found = [port for port in files if any(path.exists() for path in port)]
    used = _in_use() if found else set()
    for port in found:
        if not any(str(path) in used for path in port):
            for path in port:
                with contextlib.suppress(PermissionError):  # of another user
                    path.unlink(missing_ok=True)
