"""What an arm reports: its mode and why, the law's inside as stock messages, and how its cycles go in time."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

from slip_core.timing import ERROR, OK, WARN
from slip_core.topics import WORLD
from slip_core.types import AXES
from slip_msgs_py.events import emit
from slip_msgs_py.fast_io import Refusals, Sender, create_sender
from slip_msgs_py.messages import forms, to_msgs
from slip_msgs_py.qos import create_publisher
from slip_vic_controller.node.timing import SCALARS, STATUS_PERIOD_NS, CycleTiming
from slip_vic_controller.params.node_params import ControllerNodeParams
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.session.arm_session import ArmSession
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.session.incidents import IncidentWatch

SYMBOLS_PERIOD_NS = 10_000_000
GO_ON = "; to continue call ~/reset_fault, then ~/enable"
ENABLE = "; to continue call ~/enable"
LEVELS = {Mode.ACTIVE: OK, Mode.DEGRADED: WARN, Mode.HOLD: WARN, Mode.WAITING_INPUT: WARN, Mode.FAULT: ERROR}

Scalars = Mapping[str, float]
EVALUATED: tuple[tuple[str, forms.Form, Callable[[CycleResult, Scalars], Any]], ...] = (
    ("stiffness", forms.wrench(WORLD), lambda _, scalars: [scalars[f"K_{axis}"] for axis in AXES]),
    ("damping", forms.wrench(WORLD), lambda _, scalars: [scalars[f"D_{axis}"] for axis in AXES]),
    ("ee_pose", forms.pose(), lambda result, _: to_msgs.pose_numbers(result.arm.position, result.arm.rotation)),
    ("reference_pose", forms.pose(), lambda result, _: _pose(result.record.reference)),
    ("reference_twist", forms.twist(WORLD), lambda result, _: result.record.reference.twist),
)
"""Topics below `controller/` of a law that was evaluated: form, and the numbers of a cycle."""


class ArmReport:
    """Reports of one arm: what has changed, the symbols of the law every 10 ms, and a status each second.

    Args:
        node: owner of the publishers.
        params: of the arm.
        arm: whose reports they are.
        refusals: messages that could not be read.
        status: the node's publisher of /diagnostics; a second one would make losses uncountable.
    """

    def __init__(
        self, node: Any, params: ControllerNodeParams, arm: ArmSession, refusals: Refusals, status: Any
    ) -> None:
        self._node, self._params, self._arm, self._refusals, self._status = node, params, arm, refusals, status
        self._name, robot = node.get_fully_qualified_name().removeprefix("/"), arm.controller.robot.name
        self._hardware_id = f"{robot}/{arm.name}" if arm.name else robot
        self._mode, self._scalars_publisher = (create_publisher(node, f"controller/{k}") for k in ("mode", "scalars"))
        self._scalars: Sender | None = None
        self._evaluated = [(create_sender(node, f"controller/{name}", form), fill) for name, form, fill in EVALUATED]
        self._senders = [sender for sender, _ in self._evaluated]
        self._joints: Sender | None = None
        if arm.estimated_joints:
            self._joints = create_sender(node, "controller/joint_estimate", forms.joint_state(arm.estimated_joints))
            self._senders.append(self._joints)
        self._timing: CycleTiming | None = None
        if params.mode != "lockstep":
            self._timing = CycleTiming(params.control_period_s)
            self._send_timing = create_sender(node, "controller/timing", forms.scalars(SCALARS))
            self._senders.append(self._send_timing)
        self._last: tuple[Mode, tuple[int, ...], str] | None = None
        self._logged: set[str] = set()
        self._incidents = IncidentWatch()
        self._mode_period = self._timing_period = -1
        """Periods in which they were last on /diagnostics; those of the timing begin half a period later, since both
        in one cycle would make the next one late."""
        self._symbols_period = -1

    @property
    def publishers(self) -> tuple[Any, ...]:
        """What a recorder subscribes to."""
        return (self._scalars_publisher, *(sender.publisher for sender in self._senders))

    @property
    def missed(self) -> int:
        """Joint states that were never answered; in real time."""
        return self._timing.missed if self._timing is not None else 0

    def time(self, result: CycleResult, began_ns: int) -> None:
        """Report how a cycle that began at this steady time went, whose command has just been published."""
        if self._timing is None:
            return
        wall_ns = time.time_ns()
        self._send_timing.send(wall_ns, self._timing.add(began_ns, time.monotonic_ns(), wall_ns, result.ledger))
        period = (wall_ns + STATUS_PERIOD_NS // 2) // STATUS_PERIOD_NS
        if period != self._timing_period:
            self._timing_period = period
            self._publish_status(wall_ns, "timing", *self._timing.status())

    def publish(self, result: CycleResult) -> None:
        """Report a cycle."""
        self._report_mode(result)
        period = result.joint.stamp_ns // SYMBOLS_PERIOD_NS
        if not len(result.numbers) or period == self._symbols_period:
            return
        self._symbols_period = period
        stamp_ns, scalars, record = result.joint.stamp_ns, result.scalars(), result.record
        shown = scalars | {"mode": float(result.mode), "path_speed": float(record.path_scale)}
        if self._scalars is None:  # the names are the same in every cycle, and known with the first
            self._scalars = Sender(self._scalars_publisher, forms.scalars(tuple(shown)))
        self._scalars.send(stamp_ns, tuple(shown.values()))
        if self._joints is not None:
            joints, n = record.joints, len(self._arm.estimated_joints)
            self._joints.send(stamp_ns, joints.position[:n], joints.velocity[:n], joints.effort[:n])
        for sender, fill in self._evaluated if record.ok else ():
            sender.send(stamp_ns, fill(result, scalars))

    def _report_mode(self, result: CycleResult) -> None:
        mode, stamp_ns = result.mode, result.joint.stamp_ns
        go_on = GO_ON if mode == Mode.FAULT else ENABLE if mode == Mode.HOLD and not result.record.mode.enabled else ""
        now = (mode, result.reason_key, go_on)
        period = stamp_ns // STATUS_PERIOD_NS
        if period == self._mode_period and now == self._last:
            return
        self._mode_period = period
        of_arm = f"{self._arm.name}: " if self._arm.name else ""
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
        self._publish_status(stamp_ns, "mode", *self._mode_status(result, reason))

    def _log(self, level: int, line: str) -> None:
        log = self._node.get_logger()
        if level == OK:  # rclpy takes one severity of each line of code
            log.info(line)
        elif level == WARN:
            log.warning(line)
        else:
            log.error(line)

    def _mode_status(self, result: CycleResult, reason: str) -> tuple[int, str, dict[str, object]]:
        """Return level, text and values of a cycle for /diagnostics."""
        record = result.record
        near = [name for name in ("arm", "attitude") if record.ok and record.law[f"near_singular_{name}"]]
        saturated = int(record.saturated.sum())
        values = {
            "mode": result.mode.name, **result.reason_fields, "cycle": result.cycle,
            "near_singular": ", ".join(near), "saturated_joints": saturated,
        }  # fmt: skip
        refused = {f"{name} refused": count for name, count in self._refusals.counts.items()}
        level = max(LEVELS[result.mode], WARN if near or saturated else OK)
        return level, reason or result.mode.name, values | self._arm.counts() | refused

    def _publish_status(self, stamp_ns: int, name: str, level: int, text: str, values: Mapping[str, object]) -> None:
        message = to_msgs.diagnostics(stamp_ns, f"{self._name}: {name}", level, text, values, self._hardware_id)
        self._status.publish(message)


def _pose(reference: Any) -> Any:
    return to_msgs.pose_numbers(reference.position, reference.rotation)
