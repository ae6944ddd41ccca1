"""What a process requests of the system for steady ticks: core, SCHED_FIFO, locked memory, sharp timers.

Scheduling must be set before rclpy is imported, because the middleware's threads inherit it; that is what the
command of this module is for: ``python -m slip_msgs_py.realtime --cpu 1 --fifo 80 -- <module> <arguments>``. What
the system does not permit is said in one line and done without.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import os
import resource
import runpy
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from slip_core.errors import InputError
from slip_msgs_py.events import warn

_PR_SET_TIMERSLACK = 29
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_SWITCH_INTERVAL_S = 1e-4  # a busy Python thread otherwise keeps the interpreter for 5 ms


@dataclass(frozen=True, slots=True)
class ProcessOptions:
    """How a process runs: its cores (empty: all), its SCHED_FIFO priority (1 to 99), whether its memory is locked."""

    cpus: tuple[int, ...] = ()
    fifo: int | None = None
    lock_memory: bool = False

    def arguments(self) -> list[str]:
        """Return these options as arguments of this module's command."""
        words = []
        if self.cpus:
            words += ["--cpu", ",".join(map(str, self.cpus))]
        if self.fifo is not None:
            words += ["--fifo", str(self.fifo)]
        if self.lock_memory:
            words += ["--lock-memory"]
        return words


def set_up_process(options: ProcessOptions) -> list[str]:
    """Apply `options` to this process and all threads it will start; return one line per thing that was refused."""
    refused = []
    if options.cpus:
        try:
            os.sched_setaffinity(0, options.cpus)
        except (OSError, ValueError, OverflowError) as error:
            wanted, cores = _list(options.cpus), _list(sorted(os.sched_getaffinity(0)))
            refused.append(f"core {wanted} is not available ({_reason(error)}); running on {cores}")
    if options.fifo is not None:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(options.fifo))
        except (OSError, ValueError, OverflowError) as error:
            refused.append(
                f"SCHED_FIFO {options.fifo} is not permitted ({_reason(error)}); running at normal priority "
                "(allow it with `rtprio 99` in /etc/security/limits.conf or with CAP_SYS_NICE)"
            )
    if options.lock_memory:
        refused += _lock_memory()
    return refused


def set_up_interpreter() -> None:
    """Sharpen this thread's timers, shorten other threads' turns, and take all objects made so far out of gc's sight.

    To be called once everything long-lived has been made: a full collection takes 14 ms with these libraries loaded.
    """
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()


def _lock_memory() -> list[str]:
    limit, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if limit != resource.RLIM_INFINITY and os.geteuid() != 0:
        # Locking now and failing at some later allocation would be worse than not locking.
        return [
            f"memory is not locked (the limit is {limit // 1024} KiB; set `memlock unlimited` in "
            "/etc/security/limits.conf)"
        ]
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) != 0:
        return [f"memory is not locked ({os.strerror(ctypes.get_errno())})"]
    return []


def _list(cores: Iterable[int]) -> str:
    return ", ".join(map(str, cores))


def parse_cores(text: str) -> tuple[int, ...]:
    """Read a list of cores such as ``2`` or ``2,3``.

    Raises:
        InputError: where it is none.
    """
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError:
        raise InputError("--cpu", got=text, expected="a core or several: 2 or 2,3") from None


def _reason(error: Exception) -> str:
    return error.strerror or str(error) if isinstance(error, OSError) else str(error)


def main(argv: Sequence[str] | None = None) -> None:
    """Set this process up and run a module in it as ``__main__``."""
    parser = argparse.ArgumentParser(prog="python -m slip_msgs_py.realtime", description=main.__doc__)
    parser.add_argument("--cpu", type=parse_cores, default=(), help="core to run on, or several: 0,2")
    parser.add_argument("--fifo", type=int, help="SCHED_FIFO priority, 1 to 99")
    parser.add_argument("--lock-memory", action="store_true", help="keep all memory in RAM")
    parser.add_argument("module", help="module to run, e.g. slip_sim_bridge.main")
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="its arguments")
    words = parser.parse_args(argv)
    for line in set_up_process(ProcessOptions(words.cpu, words.fifo, words.lock_memory)):
        warn(words.module, line)
    sys.argv = [words.module, *(word for word in words.arguments if word != "--")]
    runpy.run_module(words.module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
