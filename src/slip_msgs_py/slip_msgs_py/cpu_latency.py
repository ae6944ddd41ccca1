"""Keep cores awake: one that sleeps between two messages wakes up late, in a virtual machine by milliseconds."""

from __future__ import annotations

import contextlib
import os
import signal
import struct

from slip_msgs_py.stop_flag import end_with

LATENCY_FILE = "/dev/cpu_dma_latency"


class CpuLatency:
    """While this process lives, its cores do not sleep.

    The kernel's own way is a request for a wake-up latency of 0, which lasts as long as a file is open that is root's.
    Any user can do it with a process of idle priority on each core that matters: it runs only where nothing else does.

    Args:
        cores: to keep awake where the file may not be opened.
        latency_file: of the kernel.
    """

    def __init__(self, cores: tuple[int, ...] = (), latency_file: str = LATENCY_FILE) -> None:
        self._file: int | None = None
        self.pids: tuple[int, ...] = ()
        try:
            self._file = os.open(latency_file, os.O_WRONLY)
            os.write(self._file, struct.pack("i", 0))
        except OSError:
            self._close_file()
            self.pids = tuple(_idle_process(core) for core in cores)

    @property
    def by_kernel(self) -> bool:
        """Whether the kernel does it."""
        return self._file is not None

    def end(self) -> None:
        """Let the cores sleep again."""
        self._close_file()
        for pid in self.pids:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
            with contextlib.suppress(ChildProcessError):
                os.waitpid(pid, 0)
        self.pids = ()

    def _close_file(self) -> None:
        if self._file is not None:
            os.close(self._file)
            self._file = None


def _idle_process(core: int) -> int:
    """Start a process that runs on a core whenever nothing else does, and ends with this one."""
    parent = os.getpid()
    pid = os.fork()
    if pid:
        return pid
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)
        end_with(parent)
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
        os.sched_setaffinity(0, (core,))
        while os.getppid() == parent:  # also where the kernel sends no signal
            for _ in range(1_000_000):
                pass  # to be busy is the work
    finally:
        os._exit(0)
