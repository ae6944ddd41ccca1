"""Engines run independent tasks on many workers: the process pool of this machine, or a Ray cluster.

A worker that dies costs only time: its task runs again, and one that kills `DEATHS` workers is given up.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Literal, NamedTuple, Self, TypeVar

DEATHS = 3
"""How many workers one task may kill."""

EngineName = Literal["pool", "ray"]
Shared = TypeVar("Shared")
Task = TypeVar("Task")
Result = TypeVar("Result")


class Died(NamedTuple):
    """In the place of a result: the worker died, and what is known of it."""

    reason: str


class Engine(ABC):
    """Runs tasks on workers; a context manager whose end stops the workers."""

    def __init__(self) -> None:
        self.deaths: list[tuple[Any, str]] = []
        """Every worker that died: its task, and what is known of it."""

    def __enter__(self) -> Self:
        return self

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
        busy = 0
        while True:
            while self._has_room() and (task := again.pop() if again else next(waiting, None)) is not None:
                self._begin(call, shared, task)
                busy += 1
            if not busy:
                return
            task, result = self._next()
            busy -= 1
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
    def _begin(self, call: Callable[[Any, Any], Any], shared: Any, task: Any) -> None:
        """Give a task to a worker."""

    @abstractmethod
    def _next(self) -> tuple[Any, Any]:
        """Wait for a task that has ended; return it with its result, or with `Died`."""


def open_engine(name: EngineName, jobs: int) -> Engine:
    """Return an engine.

    Args:
        name: which.
        jobs: number of worker processes; a Ray cluster that runs already has its own.

    Raises:
        InputError: Ray is not installed, or there is no cluster at RAY_ADDRESS.
    """
    if name == "ray":
        from slip_vic.experiments.engines.cluster import RayEngine

        return RayEngine(jobs)
    from slip_vic.experiments.engines.pool import PoolEngine

    return PoolEngine(jobs)
