"""Machine code that several processes compile at once."""

import multiprocessing
import os
import time
from multiprocessing.synchronize import Barrier
from pathlib import Path

import pytest

from slip_core.compiled import code_folder, part
from slip_core.vectors import Vec

PROCESSES, VALUES = 3, (3, Vec(1.0, 2.0, 3.0), (3.0,), (3.0, 3.0))
FORK = multiprocessing.get_context("fork")
DISK_S = 0.3


@part
def both(a: object, b: float) -> tuple[object, float]:
    return a, b


def _call(start: Barrier, first: int) -> None:
    start.wait()
    for k in range(len(VALUES)):
        value = VALUES[(first + k) % len(VALUES)]
        assert both(value, 1.0) == (value, 1.0)


def test_code_for_other_arguments_is_never_run_where_processes_compile_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    move = os.replace

    def slow_move(start: str, end: str) -> None:
        time.sleep(DISK_S)
        move(start, end)

    monkeypatch.setattr(os, "replace", slow_move)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    code_folder.cache_clear()
    for _ in ("compile", "load"):
        start = FORK.Barrier(PROCESSES)
        workers = [FORK.Process(target=_call, args=(start, first)) for first in range(PROCESSES)]
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        assert [worker.exitcode for worker in workers] == [0] * PROCESSES
    code_folder.cache_clear()
