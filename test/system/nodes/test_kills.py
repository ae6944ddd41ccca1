"""Controller and bridge, killed and started again at once: heard, and the law is back or the reason says how."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from slip_vic.run.processes import Child
from test.support.ros import Processes
from test.system.nodes.test_modes import BRIDGE_ENDLESS, CONTROLLER_SLOW, Start, Watcher, starter

ALONE = "bridge.expected_subscribers=0"
CALL_ENABLE = "to continue call ~/enable"


class System(NamedTuple):
    """Nodes in real time that are killed, and who watches them."""

    watcher: Watcher
    start: Start
    controller: Child
    bridge: Child


@pytest.fixture
def system(ros_node: object, processes: Processes, tmp_path: Path) -> System:
    start = starter(processes, tmp_path)
    nodes = start("controller", *CONTROLLER_SLOW), start("bridge", *BRIDGE_ENDLESS)
    watcher = Watcher(ros_node)
    watcher.wait_law()
    return System(watcher, start, *nodes)


def start_another_controller(system: System, processes: Processes, *words: str) -> Watcher:
    """Kill the controller and start another one; return who watches, who has seen nothing of it yet."""
    processes.kill(system.controller)
    system.watcher.modes.clear()
    system.start("controller", *words, *CONTROLLER_SLOW)
    return system.watcher


def test_law_returns_after_controller_kill(system: System, processes: Processes) -> None:
    start_another_controller(system, processes).wait_law()


def test_law_returns_after_bridge_kill(system: System, processes: Processes) -> None:
    watcher = system.watcher
    processes.kill(system.bridge)
    watcher.wait_mode("HOLD", "joint state is silent")
    assert CALL_ENABLE not in watcher.modes[-1]
    system.start("bridge", *BRIDGE_ENDLESS, ALONE)
    watcher.wait_law()
