"""Engines run independent tasks on many workers: the process pool of this machine, or a Ray cluster.

Whatever the engine, a worker that dies costs only time: its task runs again elsewhere, and one that kills `DEATHS`
workers is given up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Literal, NamedTuple, Protocol, Self, TypeVar

DEATHS = 3
"""How many workers one task may kill."""

EngineName = Literal["pool", "ray"]
Shared = TypeVar("Shared")
Task = TypeVar("Task")
Result = TypeVar("Result")


class Died(NamedTuple):
    """What stands in the place of a result where a task killed its worker `DEATHS` times."""

    reason: str


class Engine(Protocol):
    """Runs tasks on workers; a context manager whose end stops the workers.

    deaths: how many workers have died so far.
    """

    deaths: int

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: object, error: object, trace: object, /) -> None: ...

    def run(
        self, call: Callable[[Shared, Task], Result], shared: Shared, tasks: Iterable[Task]
    ) -> Iterator[tuple[Task, Result | Died]]:
        """Yield every task with call(shared, task), in the order of completion.

        Args:
            call: a function of a module; what it raises is raised here, and ends the run.
            shared: the same for all tasks; pickled, as everything that goes to a worker.
            tasks: hashable, each different.
        """
        ...


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
