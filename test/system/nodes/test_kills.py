"""Controller and bridge, killed and started again at once: heard, and the law is back or the reason says how."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import psutil
import pytest

from slip_msgs_py.dead_ports import NODE, NODE_AT, PORT, PORT_OK
from slip_msgs_py.events import Started
from slip_vic.run.processes import Child
from slip_vic.run.shared_memory import FIRST_PORT, PORTS_PER_DOMAIN
from test.support.ros import Processes
from test.system.nodes.test_modes import BRIDGE_ENDLESS, CONTROLLER_SLOW, Start, Watcher, starter

ALONE = "bridge.wait_for=[]"
BY_HAND = "controller.safety.auto_enable=false"
CALL_ENABLE = "to continue call ~/enable"


def port_of(node: Child, domain: int) -> Path | None:
    """Return the port of shared memory at which a process listens in its domain: it holds the lock."""
    files = [Path(file.path) for file in psutil.Process(node.pid).open_files()]
    first = FIRST_PORT + PORTS_PER_DOMAIN * domain
    of_domain = {f"{PORT}{number}_el" for number in range(first, first + PORTS_PER_DOMAIN)}
    return next((file.with_name(file.name.removesuffix("_el")) for file in files if file.name in of_domain), None)


def in_order(port: bytes) -> bool:
    return bool(NODE.unpack(port[NODE_AT : NODE_AT + NODE.size])[-1] & PORT_OK)


def test_what_others_have_open_of_a_killed_node_has_failed_once_another_listens_there(
    ros_domain: int, processes: Processes, tmp_path: Path
) -> None:
    """Else they write on into it. There are no others here, and so no watchdog of theirs that would find it in time."""
    start = starter(processes, tmp_path)
    killed = start("bridge", *BRIDGE_ENDLESS, ALONE)
    processes.wait_event(killed, Started)
    port = port_of(killed, ros_domain)
    assert port is not None
    with port.open("rb") as file:
        processes.kill(killed)
        again = start("bridge", *BRIDGE_ENDLESS, ALONE)
        processes.wait_event(again, Started)
        assert port_of(again, ros_domain) == port
        assert in_order(port.read_bytes())
        assert not in_order(file.read())


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


def test_after_a_kill_of_the_controller_the_law_is_back_by_itself(system: System, processes: Processes) -> None:
    start_another_controller(system, processes).wait_law()


def test_after_a_kill_of_a_controller_that_is_enabled_by_hand_the_reason_says_what_to_call(
    system: System, processes: Processes
) -> None:
    watcher = start_another_controller(system, processes, BY_HAND)
    watcher.wait_mode("HOLD", CALL_ENABLE)  # on a busy machine after an input that was silent at first, too
    assert watcher.trigger("enable").success
    watcher.wait_law()


def test_after_a_kill_of_the_bridge_the_reason_names_what_is_silent_and_the_law_is_back_by_itself(
    system: System, processes: Processes
) -> None:
    watcher = system.watcher
    processes.kill(system.bridge)
    watcher.wait_mode("HOLD", "joint state is silent")
    assert CALL_ENABLE not in watcher.modes[-1]
    system.start("bridge", *BRIDGE_ENDLESS, ALONE)
    watcher.wait_law()
