"""Topics of one arm at the controller: samples in, command, ledger, mode and diagnostics out."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType

from slip_core.arms import prefix_of
from slip_core.arrays import Array
from slip_core.topics import contact_topic
from slip_core.types import JointSample, WrenchSample
from slip_msgs_py.fast_io import Refusals, create_receiver, create_sender
from slip_msgs_py.messages import forms, from_msgs
from slip_msgs_py.node_shell import NodePart
from slip_vic_controller.node.report import ArmReport
from slip_vic_controller.params.node_params import ControllerNodeParams
from slip_vic_controller.session.arm_session import ArmSession
from slip_vic_controller.session.cycle_result import NO_NUMBERS, CycleResult

STATE_DEPTH = {True: 100, False: 1}  # lockstep loses nothing, nor does slip; else only the newest matters
LOOK_S = 0.02  # so long a foreign command may go unseen; a look takes some 30 us


class ArmTopics:
    """Topics of one arm: below its name, where there are several; its pad is contact 0 then, the others are theirs.

    Args:
        node: owner of everything.
        params: of the arm.
        arm: takes its samples.
        refusals: messages that could not be read, for the report.
        status: the node's publisher of /diagnostics.
        cycle: called when a sample has come with which a cycle may be complete.
    """

    def __init__(
        self,
        node: Any,
        params: ControllerNodeParams,
        arm: ArmSession,
        refusals: Refusals,
        status: Any,
        cycle: Callable[[], None],
    ) -> None:
        self._node, self._refusals, self._cycle = NodePart(node, prefix_of(arm.name)), refusals, cycle
        self.params, self.arm = params, arm
        self._lockstep = self.params.mode == "lockstep"
        part, names, contacts = self._node, self.params.joint_names, arm.contacts
        self._interface = self.params.command.interface
        # Without events, so that configured again at once it does not count as a second publisher.
        self._send_command = create_sender(
            part, f"{self._interface}_command", forms.joint_command(names, self._interface), events=False
        )
        self._send_array = (
            create_sender(part, f"{self._interface}_controller/commands", forms.numbers(len(names)))
            if self._interface != "effort" or self.params.publish_effort_array
            else None
        )
        self._send_grip = (
            create_sender(part, "grip_command", forms.number()) if self.params.grip.control == "follow" else None
        )
        numbers = 3 + 4 * contacts + 5 + self.arm.controller.external
        self._send_ledger = create_sender(part, "controller/ledger", forms.whole_numbers(numbers))
        self.report = ArmReport(part, params, arm, refusals, status)
        self.inputs = self._create_inputs()
        part.create_timer(LOOK_S, self._look_for_publishers, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._look_for_publishers()

    @property
    def publishers(self) -> list[tuple[Any, int]]:
        """Publishers, and how many subscribers each must have before the node is ready."""
        recorders = self.params.expected_subscribers - 1
        return [
            (self._send_command.publisher, self.params.expected_subscribers),
            (self._send_ledger.publisher, recorders),
            *([(self._send_grip.publisher, self.params.expected_subscribers)] if self._send_grip else []),
            *((publisher, recorders) for publisher in self.report.publishers),
        ]

    def say_no_command(self) -> None:
        """Say once that there is no command any more: to a velocity drive, which continues with its last one, zero."""
        newest = self.arm.newest_joint
        if newest is None or self._lockstep:
            return
        if self._interface == "velocity":
            self._send(newest.stamp_ns, np.zeros(len(newest.position)))
        else:
            self._send_command.send(newest.stamp_ns, NO_NUMBERS)

    def _send(self, stamp_ns: int, command: Array) -> None:
        self._send_command.send(stamp_ns, command)
        if self._send_array is not None and len(command):
            self._send_array.send(stamp_ns, command)

    def command(self, result: CycleResult, began_ns: int) -> None:
        """Publish the command of a cycle that began at this steady time: what is commanded alone."""
        stamp_ns = result.joint.stamp_ns
        if self._send_grip is not None:
            self._send_grip.send(stamp_ns, (result.grip,))
        self._send(stamp_ns, result.numbers)
        self.report.time(result, began_ns)

    def tell(self, result: CycleResult) -> None:
        """Publish what no cycle waits for."""
        self._send_ledger.send(result.joint.stamp_ns, (*result.ledger, *result.decision))
        self.report.publish(result)

    def _create_inputs(self) -> list[Any]:
        depth = STATE_DEPTH[self._lockstep]

        def receive(name: str, fields: tuple[str, ...], learn: Any, deliver: Any, **options: Any) -> Any:
            return create_receiver(
                self._node, name, fields, learn, deliver, self._refusals, reliable=self._lockstep, **options
            )

        fields = ("position", "velocity", "effort")
        learn: Any = partial(from_msgs.joint_samples, joints=self.params.joint_names)
        inputs = [receive("joint_states", fields, learn, self._on_joint_state, depth=depth)]
        for contact in range(1 if self.arm.name else self.arm.contacts):
            wrench = ("wrench", "wrench", self._in_frame(WrenchSample, contact), self.arm.add_wrench, depth)
            wrenches = (wrench,) if self.params.wrench.source == "sensor" else ()
            for name, field, learn, add, keep in (*wrenches, (*self._slip_input(contact), STATE_DEPTH[True])):
                take, actual = partial(self._on_sample, add, contact), contact_topic(name, contact)
                inputs.append(receive(name, (field,), learn, take, depth=keep, actual_name=actual))
        return inputs

    def _in_frame(self, make: Any, contact: int = -1) -> Any:
        """Return what checks the frame of a message: the own wrench's, or that of the pad."""
        frame = self.params.wrench.frame if contact == 0 else ""
        return partial(from_msgs.in_frame, frame=frame or self.params.ee_frame, make=make)

    def _slip_input(self, contact: int) -> tuple[str, str, Any, Any]:
        """Return topic, field, reader and taker of what the slip sensor says."""
        if self.params.slip_input == "displacement":
            return "slip_displacement", "pose", lambda _: from_msgs.displacement_sample, self.arm.add_displacement
        if self.params.slip_input == "flag":
            return "slip_flag", "position", from_msgs.flag_samples, self.arm.add_slip
        return "slip_velocity", "twist", self._in_frame(from_msgs.slip_sample), self.arm.add_slip

    def _look_for_publishers(self) -> None:
        # Counting is quick; who they are takes a good part of a control period, and matters for two only.
        inputs = {item.topic_name: self._owners(item.topic_name, item.get_publisher_count()) for item in self.inputs}
        # Whoever is on our command topic is foreign, also under our name: a process that starts sees no ghosts.
        self.arm.set_publishers(inputs, self._node.count_publishers(self._send_command.publisher.topic_name))

    def _owners(self, topic: str, publishers: int) -> int:
        """Return how many differently named nodes publish; a killed node's ghost lives on in discovery for a while."""
        if publishers < 2:
            return publishers
        infos = self._node.get_publishers_info_by_topic(topic)
        return len({(info.node_namespace, info.node_name) for info in infos})

    # -- callbacks ---------------------------------------------------------------------------------

    def _on_joint_state(self, sample: JointSample) -> None:
        self.arm.add_joint(sample, self._now_ns())
        self._cycle()

    def _on_sample(self, add: Callable[[int, Any, int | None], None], contact: int, sample: Any) -> None:
        add(contact, sample, self._now_ns())
        if self._lockstep:
            self._cycle()

    def _now_ns(self) -> int | None:
        """Return the controller's clock: steady time; in lockstep None, there it is the joint state's stamp."""
        return None if self._lockstep else time.monotonic_ns()
