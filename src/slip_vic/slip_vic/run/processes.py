"""Child processes under supervision: their events, their last lines, and an end that leaves nothing behind."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import IO, Any, Final

import psutil

from slip_core.errors import InputError, ProtocolError, SlipVicError
from slip_msgs_py import events
from slip_msgs_py.events import Event, Kind

LAST_LINES = 12
GRACE_S = 5.0
HASTE_S = 3.0  # nodes end by themselves before that (`node_main.LONGEST_END_S`)


@dataclass(frozen=True, slots=True)
class Scheduling:
    """The cores of a process (empty: all) and its SCHED_FIFO priority (1 to 99)."""

    cores: tuple[int, ...] = ()
    fifo: int | None = None

    @contextlib.contextmanager
    def inherited(self) -> Iterator[list[str]]:
        """Let processes that this thread starts inside the block run so; yield one line per thing that was refused.

        The middleware's threads inherit it from the process: set later it would miss them.
        """
        refused = []
        cores, policy, priority = os.sched_getaffinity(0), os.sched_getscheduler(0), os.sched_getparam(0)
        if self.cores:
            try:
                os.sched_setaffinity(0, self.cores)
            except (OSError, OverflowError):
                wanted, free = (", ".join(map(str, sorted(some))) for some in (self.cores, cores))
                refused.append(f"core {wanted} is not available; running on {free}")
        if self.fifo is not None:
            try:
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self.fifo))
            except OSError as error:
                refused.append(
                    f"SCHED_FIFO {self.fifo} is not permitted ({error.strerror}); running at normal priority "
                    "(allow it with `rtprio 99` in /etc/security/limits.conf or with CAP_SYS_NICE)"
                )
        try:
            yield refused
        finally:
            os.sched_setscheduler(0, policy, priority)
            os.sched_setaffinity(0, cores)


ANYWHERE: Final = Scheduling()


class Child:
    """One supervised process: JSON events on its stdout, everything else kept as its last lines.

    Args:
        name: shown in messages.
        argv: program and arguments.
        environment: complete environment of the child.
        on_event: called from a reader thread with (name, event).
        scheduling: its cores and priority; what is refused becomes a warning.
    """

    def __init__(
        self,
        name: str,
        argv: Sequence[str],
        environment: Mapping[str, str],
        on_event: Callable[[str, Event], None],
        scheduling: Scheduling = ANYWHERE,
    ) -> None:
        self.name = name
        self._on_event = on_event
        self.lines: deque[str] = deque(maxlen=LAST_LINES)
        self.line_count = 0
        self._last: dict[Kind, Mapping[str, Any]] = {}
        # A session of its own: Ctrl-C reaches the launcher alone, which then ends the children in order.
        with scheduling.inherited() as refused:
            self._process = subprocess.Popen(
                list(argv),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                errors="replace",
                env=dict(environment),
                start_new_session=True,
            )
        for line in refused:
            on_event(name, Event("warning", {"text": line}))
        self._readers = [
            threading.Thread(target=self._read, args=(stream, is_stdout), daemon=True)
            for stream, is_stdout in ((self._process.stdout, True), (self._process.stderr, False))
        ]
        for reader in self._readers:
            reader.start()

    def _read(self, stream: IO[str], is_stdout: bool) -> None:
        for line in stream:
            text = line.rstrip("\n")
            event = events.decode(text) if is_stdout else None
            if event is None:
                self.lines.append(text)
                self.line_count += 1
            else:
                self._last[event.kind] = event.values
                self._on_event(self.name, event)

    def last(self, kind: Kind) -> Mapping[str, Any] | None:
        """Return the values of the last event of a kind; None where it has sent none."""
        return self._last.get(kind)

    @property
    def results(self) -> Mapping[str, Any]:
        """What the process reported when it was done; empty before."""
        return self.last("done") or {}

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """Exit code, None while the process runs."""
        return self._process.poll()

    def send(self, number: int) -> None:
        """Send a signal; a process that has ended is left alone."""
        if self.exit_code is None:
            with contextlib.suppress(ProcessLookupError):
                self._process.send_signal(number)

    def wait(self, timeout_s: float) -> bool:
        """Wait for the end and for the last lines; return whether the process has ended."""
        try:
            self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return False
        for reader in self._readers:
            reader.join(1.0)
        return True

    def tail(self) -> str:
        """Return its last lines, indented."""
        return "\n".join(f"    {line}" for line in self.lines) or "    (no output)"


class RefusedByChild(SlipVicError):
    """A child refused its input; its own line says what is wrong."""

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
        failed = next((child for child in self.children if child.exit_code not in (None, 0)), None)
        if failed is not None:
            failed.wait(1.0)
            if failed.exit_code == InputError.exit_code and failed.lines:
                raise RefusedByChild(failed)
            full = " (SIGBUS: /dev/shm is full)" if failed.exit_code == -signal.SIGBUS else ""
            raise ProtocolError(
                f"{failed.name} failed with exit code {failed.exit_code}{full}; last lines:\n{failed.tail()}"
            )

    def stop(self, children: Sequence[Child], *, in_haste: bool = False) -> None:
        """End these children: SIGINT, SIGTERM, then SIGKILL with all their descendants, each after a grace time.

        in_haste: without SIGINT, after which a node waits for its subscribers.
        """
        for number in (signal.SIGTERM,) if in_haste else (signal.SIGINT, signal.SIGTERM):
            running = [child for child in children if child.exit_code is None]
            if not running:
                break
            for child in running:
                child.send(signal.SIGCONT)
                child.send(number)
            deadline = time.monotonic() + (HASTE_S if in_haste else GRACE_S)
            for child in running:
                child.wait(max(0.0, deadline - time.monotonic()))
        for child in children:
            if child.exit_code is None:
                with contextlib.suppress(psutil.Error):
                    for descendant in psutil.Process(child.pid).children(recursive=True):
                        descendant.kill()
                child.send(signal.SIGKILL)
            child.wait(GRACE_S)


def python_module(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module with this interpreter."""
    return [sys.executable, "-m", module, *arguments]


def child_environment(domain_id: int) -> dict[str, str]:
    """Return the environment of a node process: its domain, one BLAS thread, events on stdout."""
    environment = dict(os.environ)
    environment["ROS_DOMAIN_ID"] = str(domain_id)
    environment.update(
        OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1", **{events.EVENTS_VARIABLE: "1"}
    )
    return environment
