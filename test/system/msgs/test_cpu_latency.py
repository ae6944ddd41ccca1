"""Cores that do not sleep: by the kernel where its file may be opened, else by processes that end with their owner."""

from __future__ import annotations

import os
import subprocess
import sys

import psutil

from slip_msgs_py.cpu_latency import CpuLatency
from test.support.ros import wait_until

ENOUGH_S = 10.0
REFUSED = "/nowhere/cpu_dma_latency"


def gone(pid: int) -> bool:
    return not psutil.pid_exists(pid) or psutil.Process(pid).status() == psutil.STATUS_ZOMBIE


def test_else_a_process_of_idle_priority_runs_on_each_core() -> None:
    cores = tuple(sorted(os.sched_getaffinity(0)))
    awake = CpuLatency(cores[-1:], REFUSED)
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


def test_they_end_with_their_owner() -> None:
    core = min(os.sched_getaffinity(0))
    make = f"CpuLatency(({core},), {REFUSED!r})"
    code = f"from slip_msgs_py.cpu_latency import CpuLatency; print(*{make}.pids, flush=True)"
    owner = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert owner.stdout is not None
    pids = [int(word) for word in owner.stdout.readline().split()]
    assert pids
    assert owner.wait(ENOUGH_S) == 0
    wait_until(lambda: all(map(gone, pids)), "them to end")
