"""The controller node: joint states, wrench and slip velocity in, joint efforts out.

A thin shell around `slip_vic_controller.core`: topics, readiness and publication; no maths here.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from slip_msgs_py import from_msgs, to_msgs
from slip_msgs_py.errors import InputError
from slip_msgs_py.node_main import emit, run_node
from slip_msgs_py.peers import Peers
from slip_msgs_py.qos import create_publisher, create_subscription
from slip_msgs_py.resources import read_text
from slip_msgs_py.ros_params import declare
from slip_msgs_py.topics import contact_topic
from slip_msgs_py.types import CartesianReference
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.inputs import Manifest
from slip_vic_controller.core.session import ControllerSession, CycleResult
from slip_vic_controller.node_params import ControllerNodeParams
from slip_vic_controller.publishing import DiagnosticsPublisher

STATE_DEPTH = {True: 100, False: 1}  # lockstep loses nothing; in real time only the newest state matters
READY_CHECK_S = 0.02


class SlipVicController(Node):
    """Answers every complete set of inputs with one effort command, stamped as the joint state it answers."""

    def __init__(self) -> None:
        super().__init__("slip_vic_controller", automatically_declare_parameters_from_overrides=True)
        self.params = declare(self, ControllerNodeParams)
        urdf = self.params.robot_description or read_text(
            self.params.robot_description_file, "parameter robot_description_file"
        )
        self._lockstep = self.params.mode == "lockstep"
        self.session = ControllerSession(VicController(self.params, urdf), lockstep=self._lockstep)
        self._order = from_msgs.JointOrder(self.params.joint_names)
        self._ready = False
        self._refused: dict[str, str] = {}
        self._executor = EventsExecutor()
        self._create_endpoints()
        self._executor.add_node(self)

    def _create_endpoints(self) -> None:
        self._pub_effort = create_publisher(self, "effort_command")
        self._pub_array = (
            create_publisher(self, "effort_controller/commands") if self.params.publish_effort_array else None
        )
        self._pub_ledger = create_publisher(self, "controller/ledger")
        self._pub_ready = create_publisher(self, "controller/ready")
        self._diagnostics = DiagnosticsPublisher(self, self.params.diagnostics.decimation)
        depth = STATE_DEPTH[self._lockstep]
        inputs = [
            create_subscription(self, "joint_states", self._on_joint_states, depth=depth, reliable=self._lockstep)
        ]
        for contact in range(self.session.contacts):
            for name, handler in (("wrench", self._on_wrench), ("slip_velocity", self._on_slip)):
                inputs.append(
                    create_subscription(
                        self,
                        name,
                        lambda message, c=contact, h=handler: h(c, message),
                        depth=100,
                        reliable=self._lockstep,
                        actual_name=contact_topic(name, contact),
                    )
                )
        if self._lockstep:
            inputs.append(create_subscription(self, "lockstep_tick", self._on_tick, depth=depth, reliable=True))
        if self.session.reference_from_topic:
            create_subscription(self, "reference", self._on_reference, depth=10, reliable=False)
        self._peers = Peers(
            self,
            publishers=[
                (self._pub_effort, self.params.expected_subscribers),
                (self._pub_ledger, self.params.expected_subscribers - 1),
                *((publisher, self.params.expected_subscribers - 1) for publisher in self._diagnostics.publishers),
            ],
            subscriptions=inputs,
        )

    # -- callbacks ---------------------------------------------------------------------------------

    def _guard(self, topic: str, convert: Callable[[], Any]) -> Any:
        """Convert one message; a bad one is dropped and reported once per kind of fault, never raised."""
        try:
            return convert()
        except InputError as error:
            if self._refused.get(topic) != str(error):
                self._refused[topic] = str(error)
                self.get_logger().error(f"{topic}: message refused: {error}")
            return None

    def _on_joint_states(self, message: Any) -> None:
        sample = self._guard("joint_states", lambda: from_msgs.joint_sample(message, self._order))
        if sample is not None:
            self.session.inputs.add_joint(sample)
            self._cycle()

    def _on_wrench(self, contact: int, message: Any) -> None:
        self.session.inputs.add_wrench(contact, from_msgs.wrench_sample(message))
        if self._lockstep:
            self._cycle()

    def _on_slip(self, contact: int, message: Any) -> None:
        self.session.inputs.add_slip(contact, from_msgs.slip_sample(message))
        if self._lockstep:
            self._cycle()

    def _on_tick(self, message: Any) -> None:
        self.session.inputs.add_manifest(Manifest.decode(message.data))
        self._cycle()

    def _on_reference(self, message: Any) -> None:
        reference: CartesianReference | None = self._guard("reference", lambda: from_msgs.cartesian_reference(message))
        if reference is not None:
            self.session.set_reference(reference)

    # -- running -----------------------------------------------------------------------------------

    def _cycle(self) -> None:
        result = self.session.cycle()
        if result is not None:
            self._publish(result)

    def _publish(self, result: CycleResult) -> None:
        message = to_msgs.effort_state(result.command, result.joint, self.params.joint_names)
        self._pub_effort.publish(message)
        if self._pub_array is not None and len(result.command.effort):
            self._pub_array.publish(to_msgs.float64_array(result.command.effort))
        self._pub_ledger.publish(to_msgs.int64_array(result.ledger))
        if result.diagnostics is not None:
            self._diagnostics.publish(result.cycle, result.joint.stamp_ns, result.diagnostics)

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Run until asked to stop."""
        while not should_stop():
            self._executor.spin_once(0.1 if self._ready else READY_CHECK_S)
            if not self._ready and not self._peers.missing():
                self._ready = True
                self._pub_ready.publish(to_msgs.string("controller"))
                emit("ready")
        emit("done", cycles=self.session.cycles, skipped=self.session.inputs.skipped)


def main() -> int:
    """Entry point of ``slip_vic_controller_node``."""
    return run_node(SlipVicController)


if __name__ == "__main__":
    sys.exit(main())
