"""Topics of one arm at the controller: samples in, command, ledger, mode and diagnostics out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock, ClockType

from slip_core.arms import prefix_of
from slip_core.arrays import Array
from slip_core.topics import contact_topic
from slip_core.types import JointSample
from slip_msgs_py.environment import emit
from slip_msgs_py.fast_io import Refusals, Sender, create_receiver, create_sender
from slip_msgs_py.messages import from_msgs, to_msgs
from slip_msgs_py.node_shell import NodePart
from slip_msgs_py.qos import create_publisher
from slip_vic_controller.node.timing import SCALARS, CycleTiming
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.safety.conditions import Mode
from slip_vic_controller.session.cycle_result import NO_NUMBERS, CycleResult, IncidentWatch
from slip_vic_controller.session.session import ArmSession

STATE_DEPTH = {True: 100, False: 1}  # lockstep loses nothing, nor does slip; else only the newest matters
SYMBOLS_PERIOD_NS, STATUS_PERIOD_NS = 10_000_000, 1_000_000_000
GO_ON = "; to continue call ~/reset_fault, then ~/enable"
ENABLE = "; to continue call ~/enable"
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
LEVELS = {Mode.ACTIVE: OK, Mode.DEGRADED: WARN, Mode.HOLD: WARN, Mode.WAITING_INPUT: WARN, Mode.FAULT: ERROR}
LOOK_S = 0.02  # so long a foreign command may go unseen; a look takes some 30 us


class ArmTopics:
    """Topics of one arm: below its name, where there are several; its pad is contact 0 then, the others are theirs.

    It reports each change of mode or reason, the symbols of the law every 10 ms, and a status every second.

    Args:
        node: owner of everything.
        params: of the arm.
        arm: takes its samples.
        refusals: messages that could not be read, for the report.
        status: the node's publisher of /diagnostics; a second one would make losses uncountable.
        cycle: called when a sample has come with which a cycle may be complete.
    """

    def __init__(
        self,
        node: Any,
        params: ControllerParams,
        arm: ArmSession,
        refusals: Refusals,
        status: Any,
        cycle: Callable[[], None],
    ) -> None:
        self._node, self._refusals, self._cycle = NodePart(node, prefix_of(arm.name)), refusals, cycle
        self.params, self.arm = params, arm
        self._lockstep = self.params.mode == "lockstep"
        part, names = self._node, self.params.joint_names
        self._interface = self.params.command.interface
        form = to_msgs.joint_state(names, self._interface)
        self._send_command = create_sender(part, f"{self._interface}_command", form)
        self._send_array = (
            create_sender(part, f"{self._interface}_controller/commands", to_msgs.NUMBERS)
            if self._interface != "effort" or self.params.publish_effort_array
            else None
        )
        self._send_grip = (
            create_sender(part, "grip_command", to_msgs.NUMBER) if self.params.grip.control == "follow" else None
        )
        self._send_ledger = create_sender(part, "controller/ledger", to_msgs.WHOLE_NUMBERS)
        self._status = status
        self._name, robot = part.get_fully_qualified_name().removeprefix("/"), arm.controller.robot.name
        self._hardware_id = f"{robot}/{arm.name}" if arm.name else robot
        self._mode, self._scalars_publisher = (create_publisher(part, f"controller/{k}") for k in ("mode", "scalars"))
        self._scalars: Sender | None = None
        poses = [create_sender(part, f"controller/{name}", to_msgs.pose()) for name in ("ee_pose", "reference_pose")]
        self._send_ee_pose, self._send_reference_pose = poses
        self._senders = [self._send_ledger, *poses]
        """Of what a recorder subscribes to, beside scalars and command."""
        self._joints: Sender | None = None
        if arm.estimated_joints:
            self._joints = create_sender(part, "controller/joint_estimate", to_msgs.joint_state(arm.estimated_joints))
            self._senders.append(self._joints)
        self._timing: CycleTiming | None = None
        if not self._lockstep:
            self._timing = CycleTiming(params.control_period_s)
            self._send_timing = create_sender(part, "controller/timing", to_msgs.joint_state(SCALARS, "position"))
            self._senders.append(self._send_timing)
        self._last: tuple[Mode, tuple[int, ...], str] | None = None
        self._logged: set[str] = set()
        self._incidents = IncidentWatch()
        self._status_period = self._symbols_period = -1
        self.inputs = self._create_inputs()
        part.create_timer(LOOK_S, self._look_for_publishers, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._look_for_publishers()

    @property
    def publishers(self) -> list[tuple[Any, int]]:
        """Publishers, and how many subscribers each must have before the node is ready."""
        expected = self.params.expected_subscribers
        return [
            (self._send_command.publisher, expected),
            *([(self._send_grip.publisher, expected)] if self._send_grip else []),
            (self._scalars_publisher, expected - 1),
            *((sender.publisher, expected - 1) for sender in self._senders),
        ]

    @property
    def missed(self) -> int:
        """Joint states that were never answered; in real time."""
        return self._timing.missed if self._timing is not None else 0

    def say_no_command(self) -> None:
        """Send one last command without numbers; to a velocity drive, which would continue with its last one, zeros."""
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
        if self._timing is not None:
            wall_ns = time.time_ns()
            self._send_timing.send(wall_ns, self._timing.add(began_ns, time.monotonic_ns(), wall_ns, result.ledger))

    def tell(self, result: CycleResult) -> None:
        """Publish what no cycle waits for."""
        self._send_ledger.send(result.joint.stamp_ns, (*result.ledger, *result.decision))
        self._report_mode(result)
        period = result.joint.stamp_ns // SYMBOLS_PERIOD_NS
        if not len(result.numbers) or period == self._symbols_period:
            return
        self._symbols_period = period
        stamp_ns, scalars, record = result.joint.stamp_ns, result.scalars(), result.record
        shown = scalars | {"mode": float(result.mode), "path_speed": float(record.path_scale)}
        if self._scalars is None:  # the names are the same in every cycle, and known with the first
            self._scalars = Sender(self._scalars_publisher, to_msgs.joint_state(tuple(shown), "position"))
        self._scalars.send(stamp_ns, tuple(shown.values()))
        if self._joints is not None:
            joints, n = record.joints, len(self.arm.estimated_joints)
            self._joints.send(stamp_ns, joints.position[:n], joints.velocity[:n], joints.effort[:n])
        if record.ok:
            for sender, pose in ((self._send_ee_pose, result.arm), (self._send_reference_pose, record.reference)):
                sender.send(stamp_ns, to_msgs.pose_numbers(pose.position, pose.rotation))

    def _report_mode(self, result: CycleResult) -> None:
        mode = result.mode
        go_on = GO_ON if mode == Mode.FAULT else ENABLE if mode == Mode.HOLD and not result.record.mode.enabled else ""
        now = (mode, result.reason_key, go_on)
        period = result.joint.stamp_ns // STATUS_PERIOD_NS
        if period == self._status_period and now == self._last:
            return
        self._status_period = period
        of_arm = f"{self.arm.name}: " if self.arm.name else ""
        incident = self._incidents.see(result)
        if incident is not None:
            emit("incident", **(asdict(incident) | {"text": of_arm + incident.text}))
        reason = result.reason + go_on
        if now != self._last:
            line = f"{mode.name}: {reason}" if reason else mode.name
            self._mode.publish(to_msgs.string(line))
            # Another reason for the same mode is on the topic alone; but what it waits for is logged once each.
            waits = mode == Mode.WAITING_INPUT and line not in self._logged
            if self._last is None or mode != self._last[0] or waits:
                self._log(LEVELS[mode], of_arm + line)
                self._logged.add(line)
        self._last = now
        self._publish_status(result, reason)

    def _log(self, level: bytes, line: str) -> None:
        log = self._node.get_logger()
        if level == OK:  # rclpy takes one severity of each line of code
            log.info(line)
        elif level == WARN:
            log.warning(line)
        else:
            log.error(line)

    def _publish_status(self, result: CycleResult, reason: str) -> None:
        """Publish mode, reason and counts of a cycle on /diagnostics."""
        record = result.record
        near = [name for name in ("arm", "attitude") if record.ok and record.law[f"near_singular_{name}"]]
        saturated = int(record.saturated.sum())
        values = {
            "mode": result.mode.name, **result.reason_fields, "cycle": result.ledger[0],
            "near_singular": ", ".join(near), "saturated_joints": saturated, **self.arm.counts(),
        }  # fmt: skip
        if self._timing is not None:
            values |= {"overruns": self._timing.overruns, "missed": self._timing.missed}
        values |= {f"{name} refused": count for name, count in self._refusals.counts.items()}
        level, text = max(LEVELS[result.mode], WARN if near or saturated else OK), reason or result.mode.name
        stamp_ns, name = result.joint.stamp_ns, f"{self._name}: mode"
        self._status.publish(to_msgs.diagnostics(stamp_ns, name, level, text, values, self._hardware_id))

    def _create_inputs(self) -> list[Any]:
        params, depth = self.params, STATE_DEPTH[self._lockstep]

        def receive(name: str, read: Any, deliver: Any, **options: Any) -> Any:
            return create_receiver(self._node, name, read, deliver, self._refusals, reliable=self._lockstep, **options)

        read_joints = partial(from_msgs.joint_sample, joints=params.joint_names)
        inputs = [receive("joint_states", read_joints, self._on_joint_state, depth=depth)]
        for contact in range(1 if self.arm.name else self.arm.contacts):
            # The own wrench may be in a frame of its own; everything else is in that of the pad.
            frame = (params.wrench.frame if contact == 0 else "") or params.ee_frame
            wrench = ("wrench", partial(from_msgs.wrench_sample, frame=frame), self.arm.add_wrench, depth)
            wrenches = (wrench,) if params.wrench.source == "sensor" else ()
            for name, read, add, keep in (*wrenches, (*self._slip_input(), STATE_DEPTH[True])):
                take = partial(self._on_sample, add, contact)
                inputs.append(receive(contact_topic(name, contact), read, take, depth=keep))
        return inputs

    def _slip_input(self) -> tuple[str, Any, Any]:
        """Return topic, reader and receiver of the slip sensor's messages."""
        if self.params.slip_input == "displacement":
            read = partial(from_msgs.slip_displacement, frame=self.params.ee_frame)
            return "slip_displacement", read, self.arm.add_displacement
        if self.params.slip_input == "flag":
            return "slip_flag", from_msgs.slip_flags, self.arm.add_slip
        return "slip_velocity", partial(from_msgs.slip_velocity, frame=self.params.ee_frame), self.arm.add_slip

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
