"""Calls of services at the moment of a transition: the node lives, whatever order they arrive in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from std_srvs.srv import Trigger

from test.support.ros import Processes
from test.system.nodes.test_modes import Watcher, starter

ROUNDS = 8


@pytest.mark.parametrize(
    "services", [("enable", "cleanup", "enable"), ("enable", "hold", "cleanup", "tare", "reset_fault")]
)
def test_a_call_beside_a_transition_ends_nothing(
    processes: Processes, ros_node: Any, tmp_path: Path, services: tuple[str, ...]
) -> None:
    start = starter(processes, tmp_path)
    child = start("controller")
    watcher = Watcher(ros_node)
    clients = {
        name: ros_node.create_client(Trigger, f"/slip_vic_controller/{name}") for name in services if name != "cleanup"
    }
    change = ros_node.create_client(ChangeState, "/slip_vic_controller/change_state")
    cleanup = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CLEANUP))
    for _ in range(ROUNDS):
        watcher.spin(lambda: all(client.service_is_ready() for client in clients.values()), "services")
        assert watcher.change(Transition.TRANSITION_DEACTIVATE)
        answers = [
            change.call_async(cleanup) if name == "cleanup" else clients[name].call_async(Trigger.Request())
            for name in services
        ]
        cleaned = answers[services.index("cleanup")]
        watcher.spin(cleaned.done, "cleanup")
        assert cleaned.result().success
        assert child.poll() is None, child.tail()
        assert watcher.change(Transition.TRANSITION_CONFIGURE)
        assert watcher.change(Transition.TRANSITION_ACTIVATE)
    state = watcher.call(GetState, "/slip_vic_controller/get_state", GetState.Request()).current_state
    assert state.label == "active"
    assert child.poll() is None
