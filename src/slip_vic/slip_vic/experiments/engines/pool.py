"""Worker processes of this machine: one executor for each, so that the death of one leaves the others alone."""

from __future__ import annotations

import contextlib
import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import resource_tracker
from typing import Any, Self

from slip_vic.experiments.engines import DEATHS, Died, Result, Shared, Task

# Linear algebra is 6x6 here: threads of their own would only fight the other workers.
_SINGLE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class PoolEngine:
    """See `Engine`.

    Args:
        jobs: number of worker processes.
    """

    def __init__(self, jobs: int) -> None:
        os.environ.update(_SINGLE_THREAD)
        self.deaths = 0
        self._idle = [_worker() for _ in range(jobs)]
        self._busy: dict[Future[Any], ProcessPoolExecutor] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if error is not None:
            _end_children()
        # Not to wait lets the interpreter's end race with the executors' own threads, which ended some studies with a
        # traceback behind their table. Without an error none has a task, with one none has a process.
        for worker in (*self._idle, *self._busy.values()):
            worker.shutdown(cancel_futures=True)

    def run(
        self, call: Callable[[Shared, Task], Result], shared: Shared, tasks: Iterable[Task]
    ) -> Iterator[tuple[Task, Result | Died]]:
        """See `Engine`."""
        waiting, again = iter(tasks), list[Task]()
        killed = Counter[Task]()
        task_of: dict[Future[Result], Task] = {}
        while True:
            while self._idle and (task := again.pop() if again else next(waiting, None)) is not None:
                task_of[self._submit(call, shared, task)] = task
            if not task_of:
                return
            done, _ = wait(task_of, return_when=FIRST_COMPLETED)
            for future in done:
                task, worker = task_of.pop(future), self._busy.pop(future)
                try:
                    result = future.result()
                except BrokenProcessPool:
                    self._replace(worker)
                    killed[task] += 1
                    if killed[task] < DEATHS:
                        again.append(task)
                    else:
                        yield task, Died(f"its process died {DEATHS} times")
                else:
                    self._idle.append(worker)
                    yield task, result

    def _submit(self, call: Callable[[Shared, Task], Result], shared: Shared, task: Task) -> Future[Result]:
        """Give a task to a worker that waits; one that died while it waited is replaced."""
        while True:
            worker = self._idle.pop()
            try:
                with _interrupts_later():
                    future = worker.submit(call, shared, task)
            except BrokenProcessPool:
                self._replace(worker)
            else:
                self._busy[future] = worker
                return future

    def _replace(self, worker: ProcessPoolExecutor) -> None:
        worker.shutdown(wait=False)
        self.deaths += 1
        self._idle.append(_worker())


def _worker() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn"), initializer=_begin)


@contextlib.contextmanager
def _interrupts_later() -> Iterator[None]:
    """Hold SIGINT back while processes are started: they inherit the mask, so that Ctrl-C is left to this one."""
    resource_tracker.ensure_running()  # it would lift the mask
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_children() -> None:
    """End the worker processes: who waits for their executors would wait until their cases are done."""
    for child in multiprocessing.active_children():
        child.terminate()


def _begin() -> None:
    """Leave Ctrl-C to the parent, and end with it even where it is killed: a queue alone would wait without end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    multiprocessing.connection.wait([parent.sentinel])
    os._exit(1)
