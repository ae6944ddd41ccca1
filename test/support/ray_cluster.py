"""A Ray cluster of several nodes as processes on this machine, and killing parts of it."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from typing import Any

import psutil


@contextlib.contextmanager
def ray_cluster(nodes: int) -> Iterator[Any]:
    """Start a head without cores and so many nodes; RAY_ADDRESS names it while the block runs."""
    from ray.cluster_utils import Cluster

    before = os.environ.get("RAY_ADDRESS")
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    try:
        for _ in range(nodes):
            cluster.add_node(num_cpus=1)
        os.environ["RAY_ADDRESS"] = cluster.address
        yield cluster
    finally:
        os.environ.pop("RAY_ADDRESS")
        if before is not None:
            os.environ["RAY_ADDRESS"] = before
        cluster.shutdown()


def busy_workers(task: str) -> list[psutil.Process]:
    """Return the worker processes that run a task of this name: Ray writes it into their title."""
    found = []
    for process in psutil.process_iter(["cmdline"]):
        if (process.info["cmdline"] or [""])[0] == f"ray::{task}":
            found.append(process)
    return found
