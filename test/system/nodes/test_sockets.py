"""What of a node can be reached from another machine: nothing, unless somebody says otherwise."""

# ruff: noqa: F811 - fixtures are found by name

from __future__ import annotations

from pathlib import Path
from typing import Any

import psutil
import pytest

from slip_msgs_py.environment import PROFILES, RANGE
from test.support.ros import Processes
from test.system.nodes.test_modes import BRIDGE_ENDLESS, CONTROLLER_SLOW, Watcher, start, watcher  # noqa: F401

LOOPBACK, DISCOVERY = "127.0.0.1", "239.255.0.1"


def assert_loopback_only(pid: int) -> None:
    """Listen to the group of discovery, too, which was joined on the loopback interface."""
    sockets = {each.laddr.ip for each in psutil.Process(pid).net_connections("inet")}
    assert LOOPBACK in sockets
    assert sockets <= {LOOPBACK, DISCOVERY}


def assert_no_shared_memory(pid: int) -> None:
    assert "/dev/shm/fast" not in Path(f"/proc/{pid}/maps").read_text()


def test_nodes_listen_on_loopback_only(watcher: Watcher, start: Any) -> None:
    nodes = [start("controller", *CONTROLLER_SLOW), start("bridge", *BRIDGE_ENDLESS)]
    watcher.wait_law()
    for node in nodes:
        assert_loopback_only(node.pid)
        assert_no_shared_memory(node.pid)


@pytest.mark.parametrize("reach", [None, "LOCALHOST"])
def test_local_stranger_hears_topics(processes: Processes, reach: str | None) -> None:
    """It has shared memory too, and sockets on every interface."""
    processes.python("ours", "-m", "test.campaigns.attacks.flood", "wrench", "50", "60")
    for name in (RANGE, *PROFILES):
        processes.environment.pop(name, None)
    if reach is not None:
        processes.environment[RANGE] = reach
    stranger = processes.python("stranger", str(Path(__file__).with_name("stranger.py")))
    assert processes.wait_end(stranger) == 0, stranger.tail()
    assert "wrench: heard, 1 known" in stranger.tail()
