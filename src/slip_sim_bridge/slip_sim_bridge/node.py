"""The bridge node: publishes what the simulated arm and its sensors measure, applies the efforts that come back.

A thin shell around `slip_sim_bridge.sim`: topics, clock, lockstep and pacing; no physics here.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

from slip_msgs_py import from_msgs, to_msgs
from slip_msgs_py.errors import InputError, ProtocolError
from slip_msgs_py.node_main import emit, run_node
from slip_msgs_py.peers import Peers, wait_until
from slip_msgs_py.qos import create_publisher, create_subscription
from slip_msgs_py.resources import read_text
from slip_msgs_py.ros_params import declare
from slip_msgs_py.stamps import split_ns, stamp_to_ns
from slip_msgs_py.topics import contact_topic
from slip_msgs_py.types import EffortCommand
from slip_sim_bridge.node_params import BridgeNodeParams
from slip_sim_bridge.session import NO_EFFORT, BridgeSession, TickOutputs

PROGRESS_EVERY_S = 0.1


class SlipSimBridge(Node):
    """Publishes joint states, wrench, slip, ground truth and clock; waits for or samples effort commands."""

    def __init__(self) -> None:
        super().__init__("slip_sim_bridge", automatically_declare_parameters_from_overrides=True)
        self.params = declare(self, BridgeNodeParams)
        urdf = self.params.robot_description or read_text(
            self.params.robot_description_file, "parameter robot_description_file"
        )
        self.session = BridgeSession(self.params, urdf)
        self._lockstep = self.params.mode == "lockstep"
        self._order = from_msgs.JointOrder(self.params.joint_names)
        self._command: EffortCommand | None = None
        self._refused = ""
        self._peers_ready: set[str] = set()
        self._executor = EventsExecutor()
        self._create_endpoints(urdf)
        self._executor.add_node(self)

    def _create_endpoints(self, urdf: str) -> None:
        contacts = range(self.session.contacts)
        self._pub_joint = create_publisher(self, "joint_states")
        self._pub_wrench = [create_publisher(self, "wrench", actual_name=contact_topic("wrench", i)) for i in contacts]
        self._pub_slip = [
            create_publisher(self, "slip_velocity", actual_name=contact_topic("slip_velocity", i)) for i in contacts
        ]
        self._pub_object = create_publisher(self, "object_state")
        self._pub_truth = create_publisher(self, "slip_truth")
        self._pub_clock = create_publisher(self, "/clock")
        self._pub_tick = create_publisher(self, "lockstep_tick") if self._lockstep else None
        self._pub_urdf = create_publisher(self, "robot_description")
        self._pub_urdf.publish(to_msgs.string(urdf))
        self._sub_command = create_subscription(
            self, "effort_command", self._on_command, depth=10, reliable=self._lockstep
        )
        create_subscription(self, "grip_force", self._on_grip_force, depth=10, reliable=False)
        for name in self.params.wait_for:
            self._watch_ready(name)
        self.create_service(Trigger, "~/reset", self._on_reset)

    def _watch_ready(self, name: str) -> None:
        create_subscription(self, f"{name}/ready", lambda _message: self._peers_ready.add(name), depth=1, reliable=True)

    # -- callbacks ---------------------------------------------------------------------------------

    def _on_command(self, message: Any) -> None:
        if not message.effort:
            # The controller has no command for this stamp (inputs missing): the arm holds itself.
            stamp_ns = stamp_to_ns(message.header.stamp)
            self._command = EffortCommand(stamp_ns, NO_EFFORT)
            return
        try:
            self._command = from_msgs.effort_command(message, self._order)
        except InputError as error:
            if str(error) != self._refused:
                self._refused = str(error)
                self.get_logger().error(f"command refused: {error}")

    def _on_grip_force(self, message: Any) -> None:
        try:
            self.session.set_grip_force(float(message.data))
        except InputError as error:
            self.get_logger().error(f"grip force refused: {error}")

    def _on_reset(self, _request: Any, response: Any) -> Any:
        self.session.request_reset()
        response.success, response.message = True, "reset before the next tick; time goes on"
        return response

    # -- running -----------------------------------------------------------------------------------

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Run until the duration is over or the process is asked to stop."""
        if not self._wait_for_peers(should_stop):
            return
        emit("started")
        self._started_wall = time.monotonic()
        self._progress_wall = 0.0
        advance = self._advance_lockstep if self._lockstep else self._advance_realtime
        while not should_stop() and not self.session.finished:
            outputs = self.session.observe()
            self._publish(outputs)
            if not advance(outputs, should_stop):
                break
            self._report_progress()
        wall = time.monotonic() - self._started_wall
        emit("done", ticks=self.session.tick, sim_time_s=self.session.elapsed_s, wall_time_s=wall)

    def _wait_for_peers(self, should_stop: Callable[[], bool]) -> bool:
        subscribers = max(1, len(self.params.wait_for))
        peers = Peers(
            self,
            publishers=[
                (self._pub_joint, subscribers),
                (self._pub_wrench[0], subscribers),
                (self._pub_slip[0], subscribers),
            ],
            subscriptions=[self._sub_command],
        )
        wanted = set(self.params.wait_for)
        if not self._lockstep and not wanted:
            return True
        return wait_until(
            lambda: wanted <= self._peers_ready and not peers.missing(),
            spin_once=self._executor.spin_once,
            should_stop=should_stop,
            timeout_s=self.params.peer_timeout_s,
            explain=lambda: "; ".join(
                [*(f"{name} is not ready" for name in sorted(wanted - self._peers_ready)), *peers.missing()]
            ),
        )

    def _advance_lockstep(self, outputs: TickOutputs, should_stop: Callable[[], bool]) -> bool:
        """Wait for the command of this stamp, then step; False where the process was asked to stop."""
        deadline = time.monotonic() + self.params.lockstep_timeout_s
        spin_once = self._executor.spin_once
        while self._command is None or self._command.stamp_ns != outputs.stamp_ns:
            if should_stop():
                return False
            if time.monotonic() > deadline:
                last = "none" if self._command is None else f"stamp {self._command.stamp_ns} ns"
                raise ProtocolError(
                    f"lockstep: no effort_command for tick {outputs.tick} (stamp {outputs.stamp_ns} ns) within "
                    f"{self.params.lockstep_timeout_s:g} s; last command: {last}"
                    + (f"; {self._refused}" if self._refused else "")
                )
            spin_once(0.1)
        self.session.advance(self._command)
        return True

    def _advance_realtime(self, outputs: TickOutputs, should_stop: Callable[[], bool]) -> bool:
        """Take commands until the absolute deadline of this tick, then step with the newest."""
        deadline = self._started_wall + (outputs.tick + 1) * self.params.control_period_s
        while (left := deadline - time.monotonic()) > 0.0:
            if should_stop():
                return False
            self._executor.spin_once(left)
        if should_stop():
            return False
        self._executor.spin_once(0.0)
        self.session.advance(self._command)
        return True

    def _publish(self, outputs: TickOutputs) -> None:
        frame = self.params.ee_frame
        for contact, samples in enumerate(outputs.wrenches):
            for wrench in samples:
                self._pub_wrench[contact].publish(to_msgs.wrench_stamped(wrench, frame))
        for contact, slip_samples in enumerate(outputs.slips):
            for slip in slip_samples:
                self._pub_slip[contact].publish(to_msgs.slip_stamped(slip, frame))
        self._pub_joint.publish(to_msgs.joint_state(outputs.joint, self.params.joint_names))
        if self._pub_tick is not None:
            self._pub_tick.publish(to_msgs.int64_array([outputs.tick, *split_ns(outputs.stamp_ns), *outputs.counts]))
        self._pub_clock.publish(to_msgs.clock(outputs.stamp_ns))
        self._pub_object.publish(to_msgs.odometry(outputs.truth))
        self._pub_truth.publish(to_msgs.slip_truth(outputs.truth))

    def _report_progress(self) -> None:
        now = time.monotonic()
        if now - self._progress_wall > PROGRESS_EVERY_S:
            self._progress_wall = now
            emit("progress", sim_time_s=self.session.elapsed_s, ticks=self.session.tick)


def main() -> int:
    """Entry point of ``slip_sim_bridge_node``."""
    return run_node(SlipSimBridge)


if __name__ == "__main__":
    sys.exit(main())
