"""Worker processes of this machine, each with a pipe of its own: the death of one leaves the others alone."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import traceback
from collections.abc import Callable
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from slip_msgs_py.stop_flag import held_back
from slip_vic.experiments.engines import Died, Engine

# Linear algebra is 6x6 here: threads of their own would only fight the other workers.
_SINGLE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class PoolEngine(Engine):
    """See `Engine`.

    Args:
        jobs: number of worker processes.
    """

    def __init__(self, jobs: int) -> None:
        super().__init__()
        os.environ.update(_SINGLE_THREAD)
        self._jobs = jobs
        self._processes: dict[Connection, BaseProcess] = {}
        self._idle: list[Connection] = []
        self._busy: dict[Connection, Any] = {}

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            process.terminate()
        for process in self._processes.values():
            process.join()

    def _has_room(self) -> bool:
        return len(self._busy) < self._jobs

    def _begin(self, call: Callable[[Any, Any], Any], shared: Any, task: Any) -> None:
        pipe = self._idle.pop() if self._idle else self._worker()
        self._busy[pipe] = task
        with contextlib.suppress(BrokenPipeError):  # it died while it waited: `_next` finds that out
            pipe.send((call, shared, task))

    def _next(self) -> tuple[Any, Any]:
        pipe = wait(list(self._busy))[0]
        assert isinstance(pipe, Connection)
        task = self._busy.pop(pipe)
        try:
            result, error = pipe.recv()
        except (EOFError, ConnectionResetError):
            return task, Died(self._end_of(pipe))
        self._idle.append(pipe)
        if error is not None:
            raise error
        return task, result

    def _end_of(self, pipe: Connection) -> str:
        """Return how a worker died."""
        process = self._processes.pop(pipe)
        process.join()
        code = process.exitcode or 0
        return f"process {process.pid} by {signal.Signals(-code).name if code < 0 else f'exit code {code}'}"

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
