"""Engines run independent tasks on many workers: the process pool of this machine, or a Ray cluster.

A worker that dies costs only time: its task runs again, and one that kills `DEATHS` workers is given up.
"""

from __future__ import annotations

import contextlib
import importlib
import multiprocessing
import os
import signal
import socket
import traceback
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Final, NamedTuple, TypeVar

from slip_core.errors import InputError, require_extra
from slip_msgs_py.stop_flag import held_back
from slip_vic.run.processes import SINGLE_THREAD

DEATHS = 3
"""How many workers one task may kill."""
QUEUED = 2
"""Tasks that the cluster has at a time, for each of its cores: no core waits for the next one."""

ANSWER_S = 5.0
"""How long the head of a cluster may take to answer [s]."""

QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",  # nothing is sent anywhere
    "RAY_DEDUP_LOGS_SKIP_REGEX": ".",  # a screenful of advice for each dead worker; the engine names them
    "RAY_IGNORE_UNHANDLED_ERRORS": "1",  # of tasks under way when the run has ended with an error
}
"""Ray's own settings, where the user has not set them."""

Shared = TypeVar("Shared")
Task = TypeVar("Task")
Result = TypeVar("Result")


class Died(NamedTuple):
    """In the place of a result: the worker died, and what is known of it."""

    reason: str


class Engine(contextlib.AbstractContextManager["Engine"], ABC):
    """Runs tasks on workers; a context manager whose end stops the workers."""

    def __init__(self) -> None:
        self.deaths: list[tuple[Any, str]] = []
        """Every worker that died: its task, and what is known of it."""
        self._busy: dict[Any, Any] = {}
        """Task of each worker that has one."""

    @abstractmethod
    def __exit__(self, *_: object) -> None:
        """Stop the workers."""

    def run(
        self, call: Callable[[Shared, Task], Result], shared: Shared, tasks: Iterable[Task]
    ) -> Iterator[tuple[Task, Result | Died]]:
        """Yield every task with call(shared, task), in the order of completion.

        Args:
            call: a function of a module; what it raises is raised here, and ends the run.
            shared: the same for all tasks; pickled, as everything that goes to a worker.
            tasks: hashable, each different.
        """
        waiting, again, killed = iter(tasks), list[Task](), Counter[Task]()
        while True:
            while self._has_room() and (task := again.pop() if again else next(waiting, None)) is not None:
                self._busy[self._begin(call, shared, task)] = task
            if not self._busy:
                return
            worker, result = self._next()
            task = self._busy.pop(worker)
            if isinstance(result, Died):
                self.deaths.append((task, result.reason))
                killed[task] += 1
                if killed[task] < DEATHS:
                    again.append(task)
                    continue
                result = Died(f"its process died {DEATHS} times, at last {result.reason}")
            yield task, result

    @abstractmethod
    def _has_room(self) -> bool:
        """Return whether another task may begin."""

    @abstractmethod
    def _begin(self, call: Callable[[Any, Any], Any], shared: Any, task: Any) -> Any:
        """Give a task to a worker; return the worker."""

    @abstractmethod
    def _next(self) -> tuple[Any, Any]:
        """Wait for a task to end; return its worker with the result, or with `Died`."""


class PoolEngine(Engine):
    """Processes of this machine, each with a pipe of its own: the death of one leaves the others alone.

    Args:
        jobs: number of worker processes.
    """

    def __init__(self, jobs: int) -> None:
        super().__init__()
        os.environ.update(SINGLE_THREAD)
        self._jobs = jobs
        self._processes: dict[Connection, BaseProcess] = {}
        self._idle: list[Connection] = []

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            process.terminate()
        for process in self._processes.values():
            process.join()

    def _has_room(self) -> bool:
        return len(self._busy) < self._jobs

    def _begin(self, call: Callable[[Any, Any], Any], shared: Any, task: Any) -> Connection:
        pipe = self._idle.pop() if self._idle else self._worker()
        with contextlib.suppress(BrokenPipeError):  # it died while it waited: `_next` finds that out
            pipe.send((call, shared, task))
        return pipe

    def _next(self) -> tuple[Any, Any]:
        pipe = wait(list(self._busy))[0]
        assert isinstance(pipe, Connection)
        try:
            result, error = pipe.recv()
        except (EOFError, ConnectionResetError):
            process = self._processes.pop(pipe)
            process.join()
            code = process.exitcode or 0
            how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
            return pipe, Died(f"process {process.pid} by {how}")
        self._idle.append(pipe)
        if error is not None:
            raise error
        return pipe, result

    def _worker(self) -> Connection:
        context = multiprocessing.get_context("spawn")
        ours, its = context.Pipe()
        process = context.Process(target=_work, args=(its,), daemon=True)
        resource_tracker.ensure_running()  # which `start` does too, but there it would let SIGINT through again
        with held_back():
            process.start()
            self._processes[ours] = process
        its.close()
        return ours


def _work(pipe: Connection) -> None:
    """Run tasks until the other end of the pipe closes, as it does where that process is killed."""
    with contextlib.suppress(EOFError, OSError):
        while True:
            call, shared, task = pipe.recv()
            answer: tuple[Any, Exception | None]
            try:
                answer = call(shared, task), None
            except Exception as error:  # raised in the process that sent the task
                error.add_note(traceback.format_exc())
                answer = None, error
            pipe.send(answer)


class RayEngine(Engine):
    """Workers of the cluster at RAY_ADDRESS, else of one on this machine that ends with the engine.

    Args:
        jobs: cores of a cluster that is started here.

    Raises:
        InputError: Ray is not installed, or there is no cluster at RAY_ADDRESS.
    """

    def __init__(self, jobs: int) -> None:
        super().__init__()
        for name, value in QUIET.items():
            os.environ.setdefault(name, value)
        require_extra("ray", "--engine ray", "cluster")
        self._ray: Any = importlib.import_module("ray")
        # Without an address Ray joins whatever cluster a file in /tmp names.
        address = os.environ.get("RAY_ADDRESS") or "local"
        own = {"num_cpus": jobs, "include_dashboard": False} if address == "local" else {}
        try:
            if ":" in address:  # Ray itself tries for minutes before it reports that nothing answers
                host, _, port = address.rpartition(":")
                socket.create_connection((host, int(port)), ANSWER_S).close()
            self._ray.init(address=address, log_to_driver=False, logging_level="ERROR", **own)
        except (OSError, ValueError, RuntimeError) as error:
            raise InputError(
                "RAY_ADDRESS", got=f"{address} ({error})", expected="the address of a cluster",
                fix="start one with `ray start --head`, or unset RAY_ADDRESS",
            ) from None  # fmt: skip

    def __exit__(self, *_: object) -> None:
        self._ray.shutdown()

    def _has_room(self) -> bool:
        return len(self._busy) < QUEUED * max(1.0, self._ray.cluster_resources().get("CPU", 0.0))

    def _begin(self, call: Callable[[Any, Any], Any], shared: Any, task: Any) -> Any:
        # Ray's own retries are off: they say nothing of what died, and would repeat a task that kills its worker.
        remote = self._ray.remote(call).options(num_cpus=1, max_retries=0)
        return remote.remote(shared, task)

    def _next(self) -> tuple[Any, Any]:
        (done,), _ = self._ray.wait(list(self._busy), num_returns=1)
        try:
            return done, self._ray.get(done)
        except self._ray.exceptions.RayTaskError as error:
            raise error.cause from None
        except self._ray.exceptions.RayError as error:
            return done, Died(f"with {type(error).__name__}")


ENGINES: Final[dict[str, Callable[[int], Engine]]] = {"pool": PoolEngine, "ray": RayEngine}
"""By name, each made with the number of worker processes; a Ray cluster that runs already has its own."""
