"""Ray: workers on one machine or many. An extra: ``pip install 'slip-vic[cluster]'``."""

from __future__ import annotations

import importlib
import os
import socket
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Self

from slip_core.errors import InputError, SlipVicError
from slip_vic.experiments.engines import DEATHS, Died, Result, Shared, Task

QUEUED = 2
"""Tasks that the cluster has at a time, for each of its cores: no core waits for the next one."""

LOOK_S = 2.0
"""How often the number of cores is asked for, so that a node that joins gets work, and whether the nodes are there that
this process needs [s]."""

ANSWER_S = 5.0
"""How long the head of a cluster may take to answer [s]."""

QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",  # nothing is sent anywhere
    "RAY_DEDUP_LOGS_SKIP_REGEX": ".",  # a screenful of advice for each dead worker; the engine counts them
    "RAY_IGNORE_UNHANDLED_ERRORS": "1",  # of tasks under way when the run has ended with an error
}
"""Ray's own settings, where the user has not set them."""


class RayEngine:
    """See `Engine`. Joins the cluster at RAY_ADDRESS, else starts one on this machine that ends with the engine.

    Args:
        jobs: cores of a cluster that is started here.

    Raises:
        InputError: Ray is not installed, or there is no cluster at RAY_ADDRESS.
    """

    def __init__(self, jobs: int) -> None:
        for name, value in QUIET.items():
            os.environ.setdefault(name, value)
        try:
            self._ray: Any = importlib.import_module("ray")
        except ModuleNotFoundError:
            raise InputError(
                "--engine ray", got="no package ray", expected="an optional package",
                fix="install the extra slip-vic[cluster], or use --engine pool",
            ) from None  # fmt: skip
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
        self._needed = _needed(self._ray)
        self.deaths = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._ray.shutdown()

    def run(
        self, call: Callable[[Shared, Task], Result], shared: Shared, tasks: Iterable[Task]
    ) -> Iterator[tuple[Task, Result | Died]]:
        """See `Engine`.

        Ray's own retries are switched off: they are counted for a task and say nothing of who died, so that a task that
        kills its worker would do so again and again before it is noticed.

        Raises:
            SlipVicError: the node on which this process runs, or the head, has ended.
        """
        ray = self._ray
        remote = ray.remote(call).options(num_cpus=1, max_retries=0)
        common = ray.put(shared)
        waiting, again = iter(tasks), list[Task]()
        killed = Counter[Task]()
        task_of: dict[Any, Task] = {}
        look_at = cores = 0.0
        while True:
            if time.monotonic() >= look_at:
                self._look()
                look_at, cores = time.monotonic() + LOOK_S, ray.cluster_resources().get("CPU", 0.0)
            while len(task_of) < QUEUED * max(1.0, cores):
                if (task := again.pop() if again else next(waiting, None)) is None:
                    break
                task_of[remote.remote(common, task)] = task
            if not task_of:
                return
            done, _ = ray.wait(list(task_of), num_returns=1, timeout=LOOK_S)
            for reference in done:
                task = task_of.pop(reference)
                try:
                    result = ray.get(reference)
                except ray.exceptions.RayTaskError as error:
                    raise error.cause from None
                except ray.exceptions.NodeDiedError:
                    self.deaths += 1
                    again.append(task)
                except ray.exceptions.RayError as error:
                    self.deaths += 1
                    killed[task] += 1
                    if killed[task] < DEATHS:
                        again.append(task)
                    else:
                        yield task, Died(f"its process died {DEATHS} times: {type(error).__name__}")
                else:
                    yield task, result

    def _look(self) -> None:
        """Look whether what this process needs is there: Ray itself ends the process some seconds later, unsaid.

        Raises:
            SlipVicError: it is not.
        """
        for name, place in self._needed.items():
            try:
                socket.create_connection(place, ANSWER_S).close()
            except OSError as error:
                raise SlipVicError(
                    f"Ray's {name} has ended ({place[0]}:{place[1]}: {error}); rows that were written stay: start it "
                    "again, then continue with --resume"
                ) from None


def _needed(ray: Any) -> dict[str, tuple[str, int]]:
    """Return what this process cannot do without: name, and host and port where it answers."""
    here = ray.get_runtime_context()
    head, _, port = here.gcs_address.rpartition(":")
    (own,) = (node for node in ray.nodes() if node["NodeID"] == here.get_node_id())
    return {
        "node on this machine": (own["NodeManagerAddress"], own["NodeManagerPort"]), "head": (head, int(port)),
    }  # fmt: skip
