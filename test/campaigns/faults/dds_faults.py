"""How each fault of a plan begins and ends over DDS; those on messages are the proxy's."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from typing import Any

from sensor_msgs.msg import JointState

from slip_core.params import flatten
from test.campaigns.faults.dds_session import Nodes
from test.campaigns.faults.dds_watch import Watches
from test.campaigns.faults.plan import BRIDGE, RECORDER, RETUNED, Fault, retuned

REFUSED = (
    ("gains.k_s", -1.0), ("gains.stiffness", [float("nan")] * 6), ("object.mass", float("inf")),
    ("safety.limits.effort_rate", 1e9), ("control_period_s", 0.5), ("gains.stiffness", [1.0]), ("joint_names", ["x"]),
)  # fmt: skip


class FaultActions:
    """Begins and ends faults.

    Args:
        node: an rclpy node of our own.
        nodes, watch: of the campaign; where nodes have no cable the proxy drops everything instead of a cut.
    """

    def __init__(self, node: Any, nodes: Nodes, watch: Watches) -> None:
        self._node, self._nodes, self._watch, self._cable = node, nodes, watch, nodes.cable
        values = flatten(nodes.scenario.controller)
        self._arms = [prefix.replace("/", ".") for prefix, _ in nodes.scenario.arms]
        self._usual = {f"{arm}{name}": values[f"{arm}{name}"] for arm in self._arms for name in RETUNED}
        self._intruders: dict[Fault, Callable[[], None]] = {}

    def begin(self, fault: Fault) -> None:
        """Let it begin."""
        kind, target, nodes = fault.kind, fault.target, self._nodes
        if kind == "kill":
            nodes.kill(target)
        elif kind == "stop":
            nodes.send(target, signal.SIGSTOP)
        elif kind == "disk_full":
            nodes.fill_disk()
        elif kind == "cut" and self._cable is not None:
            self._cable.cut()
        elif kind == "reset":
            self._watch.teleport(time.monotonic())
            nodes.trigger("reset")
        elif kind == "grip":
            nodes.set_grip(target, self._grip_n(target) * 2.0 * fault.size**3)
        elif kind == "request":
            nodes.trigger(("enable", "hold", "reset_fault")[int(3 * fault.size)])
        elif kind == "gains":
            self._watch.begin_again()  # HOLD carries what it is told that the arm carries
            changed = [retuned(self._usual, fault.size, arm) for arm in self._arms]
            nodes.set_parameters({name: value for of_arm in changed for name, value in of_arm.items()})
        elif kind == "bad_parameter":
            name, value = REFUSED[int(len(REFUSED) * fault.size)]
            nodes.set_parameters({f"{self._arms[0]}{name}": value})
        elif kind == "second_publisher":
            self._intruders[fault] = self._intrude(target)

    def end(self, fault: Fault) -> None:
        """Let it end."""
        kind, nodes = fault.kind, self._nodes
        if kind == "kill" and fault.target != RECORDER and not nodes.runs(fault.target):
            nodes.start(fault.target)
        elif kind == "stop":
            nodes.send(fault.target, signal.SIGCONT)
        elif kind == "cut" and self._cable is not None:
            self._cable.mend()
        elif kind == "grip":
            nodes.set_grip(fault.target, self._grip_n(fault.target))
        elif kind == "second_publisher":
            self._intruders.pop(fault)()

    def restore(self) -> None:
        """Set the parameters back."""
        self._watch.begin_again()
        self._nodes.set_parameters(self._usual)

    def _grip_n(self, arm: str) -> float:
        return self._nodes.scenario.bridges[arm].grip.force

    def _intrude(self, topic: str) -> Callable[[], None]:
        """Let a node of another name appear on a topic; return what removes it."""
        from rclpy.node import Node

        intruder = Node("intruder", start_parameter_services=False, enable_rosout=False)
        publisher = intruder.create_publisher(JointState, topic, 10)
        publisher.publish(JointState())  # as empty as messages get

        def leave() -> None:
            intruder.destroy_node()

        return leave


def remote(faults: tuple[Fault, ...]) -> bool:
    """Return whether these faults need the bridge behind the cable."""
    return any(fault.kind == "cut" and fault.target == BRIDGE for fault in faults)
