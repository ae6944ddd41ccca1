"""The operator beside nodes that run: puts back an object that was lost, and ends a fault that lasts."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from slip_msgs_py.qos import create_subscription
from test.campaigns.faults.monitors import LOST_M

PATIENCE_S = 2.0  # a fault is observed before it is reset
AGAIN_S = 1.0
LOOK_S = 0.02
STEPS = (("slip_sim_bridge", "reset"), ("slip_vic_controller", "reset_fault"), ("slip_vic_controller", "enable"))


class Operator:
    """Follows mode and object.

    An object that has left the pads is put back by a reset of the simulation, and a FAULT that lasts is ended:
    simulation reset, fault reset, law enabled, a second apart.

    Args:
        node: an rclpy node of the operator's own.
        executor: runs its callbacks.
    """

    def __init__(self, node: Any, executor: Any) -> None:
        self.node, self.executor = node, executor
        self._clients = {
            (owner, service): node.create_client(Trigger, f"{owner}/{service}") for owner, service in STEPS
        }
        create_subscription(node, "controller/mode", self._on_mode, depth=1, reliable=True)
        create_subscription(node, "slip_truth", self._on_truth, depth=1, reliable=False, raw=True)
        self.mode = ""
        self.modes: set[str] = set()
        self.helps = True
        self._put_back_s = -math.inf
        self._steps: list[tuple[str, str]] = []
        self._next_s = self._next_look_s = 0.0

    def _on_mode(self, message: Any) -> None:
        mode = message.data.partition(": ")[0]
        if mode == "FAULT" and self.mode != "FAULT":
            self.restart(PATIENCE_S)
        self.mode = mode
        self.modes.add(mode)

    def _on_truth(self, data: bytes) -> None:
        now = time.monotonic()
        if now < self._next_look_s:
            return
        self._next_look_s = now + LOOK_S
        message = deserialize_message(data, JointState)
        if max(map(abs, message.position[:3]), default=0.0) > LOST_M and now - self._put_back_s > AGAIN_S:
            self._put_back_s = now
            self._clients[STEPS[0]].call_async(Trigger.Request())

    def restart(self, after_s: float = 0.0) -> None:
        """Begin the steps that end a fault."""
        self._steps, self._next_s = list(STEPS), time.monotonic() + after_s

    def attend(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Process messages for this long or until a condition holds, and do the steps that are due; return whether it
        held.
        """
        end = time.monotonic() + seconds
        while not (held := until()) and (left := end - time.monotonic()) > 0.0:
            self.executor.spin_once(timeout_sec=min(left, LOOK_S))
            if self.helps and self.mode == "FAULT" and not self._steps:
                self.restart(AGAIN_S)  # a publisher that has died counts until its lease ends
            if self.helps and self._steps and time.monotonic() >= self._next_s:
                self._clients[self._steps.pop(0)].call_async(Trigger.Request())
                self._next_s = time.monotonic() + AGAIN_S
        return held
