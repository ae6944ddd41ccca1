"""A bug in the controller does not end its node: it is a FAULT, and the law resumes once it is reset."""

# ruff: noqa: F811 - fixtures are found by name

from __future__ import annotations

from pathlib import Path
from typing import Any

from test.system.nodes.test_modes import BRIDGE_ENDLESS, CONTROLLER_SLOW, Watcher, start, watcher  # noqa: F401


def test_controller_exception_is_a_fault(watcher: Watcher, start: Any) -> None:
    controller = start("controller", *CONTROLLER_SLOW, script=Path(__file__).with_name("failing_controller.py"))
    start("bridge", *BRIDGE_ENDLESS)
    watcher.wait_mode("FAULT", "internal error", "~/reset_fault")
    count = len(watcher.commands)
    watcher.spin(lambda: len(watcher.commands) > count + 50, "efforts that go on")
    assert all(len(message.effort) == 7 for message in watcher.commands[count:])
    assert sum("failed in" in line for line in controller.lines) == 1, controller.tail()
    controller.lines.clear()  # in other tests such a line is an error
    watcher.wait_law()
