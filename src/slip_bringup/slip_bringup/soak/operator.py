"""Who stands beside a long run: puts the object back and resets the fault where one was latched."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_srvs.srv import Trigger

from slip_msgs_py.qos import create_subscription

PATIENCE_S = 2.0  # a fault is looked at before it is reset
AGAIN_S = 1.0
STEPS = (("slip_sim_bridge", "reset"), ("slip_vic_controller", "reset_fault"), ("slip_vic_controller", "enable"))


class Operator:
    """Follows the mode; a FAULT that lasts is ended: simulation reset, fault reset, law enabled, a second apart.

    Args:
        node: an rclpy node of the operator's own.
        executor: runs its callbacks.
    """

    def __init__(self, node: Any, executor: Any) -> None:
        self.executor = executor
        self._clients = {
            (owner, service): node.create_client(Trigger, f"{owner}/{service}") for owner, service in STEPS
        }
        self._subscription = create_subscription(node, "controller/mode", self._on_mode, depth=1, reliable=True)
        self.mode = ""
        self.faults: list[str] = []
        self._steps: list[tuple[str, str]] = []
        self._next_s = 0.0

    def _on_mode(self, message: Any) -> None:
        mode, _, reason = message.data.partition(": ")
        if mode == "FAULT" and self.mode != "FAULT":
            self.faults.append(reason)
            self._steps, self._next_s = list(STEPS), time.monotonic() + PATIENCE_S
        self.mode = mode

    def attend(self, timeout_s: float) -> None:
        """Hear what comes, for this time at most, and do the next step where one is due."""
        self.executor.spin_once(timeout_sec=timeout_s)
        if self._steps and time.monotonic() >= self._next_s:
            self._clients[self._steps.pop(0)].call_async(Trigger.Request())
            self._next_s = time.monotonic() + AGAIN_S


@contextmanager
def operator_of(domain: int) -> Iterator[Operator]:
    """Give an operator in a ROS domain, who leaves with the block."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain)
    node = rclpy.create_node("operator", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield Operator(node, executor)
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown(context=context)
