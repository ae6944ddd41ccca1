"""Supervise child processes: their events, their last lines, and an end that leaves nothing behind."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import IO, Any

from slip_core.errors import InputError, ProtocolError, SlipVicError
from slip_msgs_py.environment import EVENTS_VARIABLE, Event, Kind, decode

# Matrices are 6x6 here: threads for linear algebra would only compete with the other processes.
SINGLE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
LAST_LINES = 12
GRACE_S = 5.0
HASTE_S = 3.0  # nodes end by themselves before that (`node_main.LONGEST_END_S`)


class Child(subprocess.Popen[str]):
    """One supervised process: JSON events on its stdout, everything else kept as its last lines.

    Args:
        name: shown in messages.
        argv: program and arguments.
        environment: complete environment of the child.
        on_event: called from a reader thread with (name, event).
    """

    def __init__(
        self, name: str, argv: Sequence[str], environment: Mapping[str, str], on_event: Callable[[str, Event], None]
    ) -> None:
        self.name = name
        self._on_event = on_event
        self.lines: deque[str] = deque(maxlen=LAST_LINES)
        self.line_count = 0
        self.last: dict[Kind, Mapping[str, Any]] = {}
        """Values of the last event of each kind."""
        # A session of its own: Ctrl-C reaches the launcher alone, which then ends the children in order.
        super().__init__(
            list(argv),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            env=dict(environment),
            start_new_session=True,
        )
        self._readers = [
            threading.Thread(target=self._read, args=(stream, is_stdout), daemon=True)
            for stream, is_stdout in ((self.stdout, True), (self.stderr, False))
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, stream: IO[str], is_stdout: bool) -> None:
        for line in stream:
            text = line.rstrip("\n")
            event = decode(text) if is_stdout else None
            if event is None:
                self.lines.append(text)
                self.line_count += 1
            else:
                self.last[event.kind] = event.values
                self._on_event(self.name, event)

    @property
    def results(self) -> Mapping[str, Any]:
        """What the process reported when it was done; empty before."""
        return self.last.get("done", {})

    def has_ended(self, timeout_s: float) -> bool:
        """Wait for the end and for the last lines; return whether the process has ended."""
        try:
            self.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return False
        for reader in self._readers:
            reader.join(1.0)
        return True

    def tail(self) -> str:
        """Return its last lines, indented."""
        return "\n".join(f"    {line}" for line in self.lines) or "    (no output)"


class RefusedByChild(SlipVicError):
    """A child process refused its input; its own line has the reason."""

    exit_code = 2

    def __init__(self, child: Child) -> None:
        super().__init__(f"{child.name}: {child.lines[-1].removeprefix('error: ')}")


class ProcessGroup:
    """Children that live and die together; a context manager whose end leaves no process."""

    def __init__(self) -> None:
        self.children: list[Child] = []

    def __enter__(self) -> ProcessGroup:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop(self.children, in_haste=True)

    def add(self, child: Child) -> Child:
        """Take in a child, and return it."""
        self.children.append(child)
        return child

    def check(self) -> None:
        """Look whether a child has failed.

        Raises:
            RefusedByChild: the first child in order of start that ended with a code other than 0 refused its input.
            ProtocolError: it failed otherwise; with its exit code and last lines.
        """
        failed = next((child for child in self.children if child.poll() not in (None, 0)), None)
        if failed is not None:
            failed.has_ended(1.0)
            if failed.returncode == InputError.exit_code and failed.lines:
                raise RefusedByChild(failed)
            full = " (SIGBUS: /dev/shm is full)" if failed.returncode == -signal.SIGBUS else ""
            raise ProtocolError(
                f"{failed.name} failed with exit code {failed.returncode}{full}; last lines:\n{failed.tail()}"
            )

    def stop(self, children: Sequence[Child], *, in_haste: bool = False) -> None:
        """End these children: SIGINT, SIGTERM, then SIGKILL with all their descendants, each after a grace time.

        in_haste: without SIGINT, after which a node waits for its subscribers.
        """
        for number in (signal.SIGTERM,) if in_haste else (signal.SIGINT, signal.SIGTERM):
            running = [child for child in children if child.poll() is None]
            if not running:
                break
            for child in running:
                child.send_signal(signal.SIGCONT)
                child.send_signal(number)
            deadline = time.monotonic() + (HASTE_S if in_haste else GRACE_S)
            for child in running:
                child.has_ended(max(0.0, deadline - time.monotonic()))
        for child in children:
            if child.poll() is None:
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(child.pid, signal.SIGKILL)
            child.has_ended(GRACE_S)


def python_module(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module with this interpreter."""
    return [sys.executable, "-m", module, *arguments]


def placed(command: Sequence[str], cores: Sequence[int], fifo: int | None = None) -> list[str]:
    """Return a command that runs on these cores (none: all) at a SCHED_FIFO priority, with all threads of DDS.

    Raises:
        InputError: a program that this needs is not installed.
    """
    on = ["taskset", "--cpu-list", ",".join(map(str, cores))] if cores else []
    at = [] if fifo is None else ["chrt", "--fifo", str(fifo)]
    for program in on[:1] + at[:1]:
        if shutil.which(program) is None:
            raise InputError(program, got="no such program", expected="one on PATH", fix="install util-linux")
    return [*on, *at, *command]


def child_environment(domain_id: int) -> dict[str, str]:
    """Return the environment of a node process: its domain, one BLAS thread, events on stdout."""
    return {**os.environ, **SINGLE_THREAD, "ROS_DOMAIN_ID": str(domain_id), EVENTS_VARIABLE: "1"}
