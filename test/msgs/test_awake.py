"""Cores that do not sleep: by the kernel where its file may be opened, else by processes that end with their owner."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from pathlib import Path

import psutil

from slip_msgs_py.awake import Awake
from slip_msgs_py.realtime import ProcessOptions
from test.support.ros import wait_until

ENOUGH_S = 10.0
REFUSED = "/nowhere/cpu_dma_latency"


def gone(pid: int) -> bool:
    return not psutil.pid_exists(pid) or psutil.Process(pid).status() == psutil.STATUS_ZOMBIE


def test_the_kernel_is_asked_for_no_latency_for_as_long_as_it_lasts(tmp_path: Path) -> None:
    file = tmp_path / "cpu_dma_latency"
    file.touch()
    opened = lambda: [f.path for f in psutil.Process().open_files() if f.path == str(file)]  # noqa: E731
    awake = Awake(latency_file=str(file))
    assert awake.by_kernel
    assert awake.pids == ()
    assert struct.unpack("i", file.read_bytes()) == (0,)
    # psutil lists files that are open for writing too
    assert opened()
    awake.end()
    assert not opened()


def test_else_a_process_of_idle_priority_runs_on_each_core() -> None:
    cores = tuple(sorted(os.sched_getaffinity(0)))
    awake = Awake(cores[-1:], REFUSED)
    try:
        assert not awake.by_kernel
        (pid,) = awake.pids
        wait_until(lambda: os.sched_getscheduler(pid) == os.SCHED_IDLE, "idle priority")
        wait_until(lambda: os.sched_getaffinity(pid) == set(cores[-1:]), "its core")
        wait_until(lambda: psutil.Process(pid).cpu_times().user > 0.0, "it to be busy")
    finally:
        awake.end()
    assert not psutil.pid_exists(pid)
    assert awake.pids == ()


def test_without_cores_nobody_is_busy() -> None:
    awake = Awake(latency_file=REFUSED)
    assert not awake.by_kernel
    assert awake.pids == ()
    awake.end()


def test_they_end_with_their_owner() -> None:
    core = min(os.sched_getaffinity(0))
    code = f"from slip_msgs_py.awake import Awake; print(*Awake(({core},), {REFUSED!r}).pids, flush=True)"
    owner = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert owner.stdout is not None
    pids = [int(word) for word in owner.stdout.readline().split()]
    assert pids
    assert owner.wait(ENOUGH_S) == 0
    wait_until(lambda: all(map(gone, pids)), "them to end")


def test_a_process_is_kept_awake_unless_it_says_no() -> None:
    assert ProcessOptions().arguments() == ["--awake"]
    assert ProcessOptions(awake=False).arguments() == []
