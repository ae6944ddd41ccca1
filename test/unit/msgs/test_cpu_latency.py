"""Cores that do not sleep, where the kernel is asked: no process is needed."""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import psutil
import pytest

from slip_msgs_py.cpu_latency import CpuLatency
from slip_msgs_py.realtime import ProcessOptions, main

REFUSED = "/nowhere/cpu_dma_latency"


def test_the_kernel_is_asked_for_no_latency_for_as_long_as_it_lasts(tmp_path: Path) -> None:
    file = tmp_path / "cpu_dma_latency"
    file.touch()
    opened = lambda: [f.path for f in psutil.Process().open_files() if f.path == str(file)]  # noqa: E731
    awake = CpuLatency(latency_file=str(file))
    assert awake.by_kernel
    assert awake.pids == ()
    assert struct.unpack("i", file.read_bytes()) == (0,)
    # psutil lists files that are open for writing too
    assert opened()
    awake.end()
    assert not opened()


def test_without_cores_nobody_is_busy() -> None:
    awake = CpuLatency(latency_file=REFUSED)
    assert not awake.by_kernel
    assert awake.pids == ()
    awake.end()


def test_a_process_is_kept_awake_unless_it_says_no() -> None:
    assert ProcessOptions().arguments() == ["--awake"]
    assert ProcessOptions(awake=False).arguments() == []


def test_what_a_process_is_to_be_is_read_again_from_its_arguments(capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    """A core and a priority that no machine has are refused in one line each, and the module runs all the same."""
    options = ProcessOptions((9998, 9999), fifo=1000, lock_memory=True)
    assert options.arguments() == ["--cpu", "9998,9999", "--fifo", "1000", "--lock-memory", "--awake"]
    monkeypatch.setattr(sys, "argv", [])
    main([*ProcessOptions((9998, 9999), fifo=1000, awake=False).arguments(), "test.support.every", "--", "word"])
    said = "".join(capsys.readouterr())
    assert "core 9998, 9999 is not available" in said
    assert "SCHED_FIFO 1000 is not permitted" in said
    assert sys.argv[1:] == ["word"]
