"""Ray: workers on one machine or many. An extra: ``pip install 'slip-vic[cluster]'``."""

from __future__ import annotations

import importlib
import os
import socket
from collections.abc import Callable
from typing import Any

from slip_core.errors import InputError
from slip_vic.experiments.engines import Died, Engine

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


class RayEngine(Engine):
    """See `Engine`. Joins the cluster at RAY_ADDRESS, else starts one on this machine that ends with the engine.

    Args:
        jobs: cores of a cluster that is started here.

    Raises:
        InputError: Ray is not installed, or there is no cluster at RAY_ADDRESS.
    """

    def __init__(self, jobs: int) -> None:
        super().__init__()
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
        self._busy: dict[Any, Any] = {}

    def __exit__(self, *_: object) -> None:
        self._ray.shutdown()

    def _has_room(self) -> bool:
        return len(self._busy) < QUEUED * max(1.0, self._ray.cluster_resources().get("CPU", 0.0))

    def _begin(self, call: Callable[[Any, Any], Any], shared: Any, task: Any) -> None:
        # Ray's own retries are off: they say nothing of what died, and would repeat a task that kills its worker.
        remote = self._ray.remote(call).options(num_cpus=1, max_retries=0)
        self._busy[remote.remote(shared, task)] = task

    def _next(self) -> tuple[Any, Any]:
        (done,), _ = self._ray.wait(list(self._busy), num_returns=1)
        task = self._busy.pop(done)
        try:
            return task, self._ray.get(done)
        except self._ray.exceptions.RayTaskError as error:
            raise error.cause from None
        except self._ray.exceptions.RayError as error:
            return task, Died(f"with {type(error).__name__}")
