"""What arrives from outside, on topics, services, parameters and transitions, does not end the nodes.

Unexpected exceptions are loud in tests: a node that goes on here has met none, but for the last test's own bug.
"""

# ruff: noqa: F811 - fixtures are found by name

from __future__ import annotations

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
