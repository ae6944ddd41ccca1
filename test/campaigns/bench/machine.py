"""What the numbers were measured on, and how quiet it was."""

from __future__ import annotations

import os
import platform
import time
from pathlib import Path
from typing import Any

import numpy as np

from slip_vic.run.versions import versions

_LOOP = 20_000


def machine() -> dict[str, Any]:
    """Return processor, cores, kernel, and what real time is permitted."""
    return {
        "processor": _processor() or platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "kernel": platform.release(),
        "preemption": _preemption(),
        "fifo_permitted": fifo_permitted(),
        "versions": dict(versions()),
    }


def _processor() -> str:
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "")


def fifo_permitted() -> bool:
    """Return whether a child of this process may run under SCHED_FIFO."""
    try:
        policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
        os.sched_setscheduler(0, policy, parameters)
    except OSError:
        return False
    return True


def calibration_s() -> float:
    """Return the time of a fixed piece of Python and numpy work [s]: how fast the machine is at this moment."""
    matrix, total = np.eye(6), 0.0
    start = time.perf_counter()
    for k in range(_LOOP):
        total += k * 1e-9
        if k % 20 == 0:
            matrix = matrix @ matrix
    return time.perf_counter() - start


def _preemption() -> str:
    text = platform.version()
    return next((kind for kind in ("PREEMPT_RT", "PREEMPT_DYNAMIC", "PREEMPT") if kind in text), "none")
