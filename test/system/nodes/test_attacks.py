"""What arrives from outside, on topics, services, parameters and transitions, does not end the nodes.

Unexpected exceptions are loud in tests: a node that goes on here has met none, but for the last test's own bug.
"""

# ruff: noqa: F811 - fixtures are found by name

from __future__ import annotations

import signal
import time
from pathlib import Path
from typing import Any

import pytest

from slip_msgs_py.node_shell import LOUD_VARIABLE
from test.support.ros import Processes
from test.system.nodes.test_modes import (  # noqa: F401
    BRIDGE_ENDLESS,
    CONTROLLER_SLOW,
    System,
    Watcher,
    nodes,
    shared_start,
    shared_watcher,
    start,
    watcher,
)  # fmt: skip

PROMPT_S = 0.3  # from the first foreign command to FAULT; discovery and a crowded machine included


@pytest.mark.parametrize("loud", ["0", "1"])
def test_controller_exception_is_a_fault(
    watcher: Watcher,
    start: Any,
    processes: Processes,
    loud: str,
) -> None:
    processes.environment[LOUD_VARIABLE] = loud
    controller = start("controller", *CONTROLLER_SLOW, script=Path(__file__).with_name("failing_controller.py"))
    start("bridge", *BRIDGE_ENDLESS)
    if loud == "1":
        assert processes.wait_end(controller) == 1
        assert "ZeroDivisionError: put in by a test" in controller.tail()
        return
    watcher.wait_mode("FAULT", "internal error", "~/reset_fault")
    count = len(watcher.commands)
    watcher.spin(lambda: len(watcher.commands) > count + 50, "efforts that go on")
    assert all(len(message.effort) == 7 for message in watcher.commands[count:])
    assert sum("failed in" in line for line in controller.lines) == 1, controller.tail()
    watcher.wait_law()


@pytest.mark.smoke
def test_second_controller_is_a_fault(nodes: System, shared_start: Any, shared_processes: Processes) -> None:
    from sensor_msgs.msg import JointState

    watcher = nodes.watcher
    watcher.wait_law()
    seen: list[float] = []
    watcher.node.create_subscription(JointState, "effort_command", lambda m: seen.append(m.header.stamp.sec), 100)
    foreign = watcher.node.create_publisher(JointState, "effort_command", 10)
    watcher.spin(lambda: foreign.get_subscription_count() >= 2, "the bridge to take foreign commands")
    began = time.monotonic()
    watcher.wait_mode("FAULT", "another publisher")
    assert time.monotonic() - began < PROMPT_S
    assert watcher.modes[-1].endswith("call ~/reset_fault, then ~/enable")
    watcher.node.destroy_publisher(foreign)
    watcher.wait_law()
    second = shared_start("controller", *CONTROLLER_SLOW)  # under the same name
    watcher.wait_mode("FAULT", "another publisher")
    assert nodes.controller.exit_code is None
    assert nodes.bridge.exit_code is None
    shared_processes.stop(second, signal.SIGINT)
