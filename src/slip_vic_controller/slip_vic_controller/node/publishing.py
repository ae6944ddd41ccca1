"""Publishes the law's inside as stock messages that plotting tools show by name."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from slip_core.timing import ERROR, OK, WARN
from slip_core.topics import WORLD
from slip_core.types import AXES
from slip_msgs_py.fast_io import Sender, create_sender
from slip_msgs_py.messages import forms, to_msgs
from slip_msgs_py.node_shell import OnceEvery
from slip_msgs_py.qos import create_publisher
from slip_vic_controller.node.timing import SCALARS, CycleTiming
from slip_vic_controller.params.node_params import ControllerNodeParams
from slip_vic_controller.session.cycle_result import CycleResult

DIAGNOSTICS_PERIOD_NS = 1_000_000_000
LAW_PHASE, MODE_PHASE, TIMING_PHASE = 0.0, 0.25, 0.5
"""When in a second each status is published."""


class StatusPublisher:
    """Publishes the statuses of one arm on /diagnostics.

    Args:
        publisher: the node's.
        robot: name of the robot in its URDF.
        arm: name of the arm; empty where it is the only one.
    """

    def __init__(self, publisher: Any, robot: str, arm: str) -> None:
        self._publisher = publisher
        self._hardware_id = f"{robot}/{arm}" if arm else robot

    def publish(self, stamp_ns: int, name: str, level: int, text: str, values: Mapping[str, object]) -> None:
        """Publish one status; level 0 OK, 1 WARN, 2 ERROR."""
        self._publisher.publish(to_msgs.diagnostics(stamp_ns, name, level, text, values, self._hardware_id))


class DiagnosticsPublisher:
    """Publishers of the diagnostic topics; every `decimation`-th cycle, and /diagnostics about once a second.

    Args:
        node: owner of the publishers.
        decimation: how many cycles per publication.
        status: the node's publisher of /diagnostics; a second one would make losses uncountable.
        estimated: names of the joints whose state is estimated, none where the samples are used as they are.
    """

    def __init__(self, node: Any, decimation: int, status: StatusPublisher, estimated: Sequence[str]) -> None:
        self._decimation = decimation
        self._name = node.get_fully_qualified_name().removeprefix("/")
        self._scalars: Sender | None = None
        self._scalars_publisher = create_publisher(node, "controller/scalars")
        self._stiffness = create_sender(node, "controller/stiffness", forms.wrench(WORLD))
        self._damping = create_sender(node, "controller/damping", forms.wrench(WORLD))
        self._ee_pose = create_sender(node, "controller/ee_pose", forms.pose())
        self._reference_pose = create_sender(node, "controller/reference_pose", forms.pose())
        self._reference_twist = create_sender(node, "controller/reference_twist", forms.twist(WORLD))
        self._joints = (
            [create_sender(node, "controller/joint_estimate", forms.joint_state(estimated))] if estimated else []
        )
        self._status, self._joint_count = status, len(estimated)
        senders = (self._stiffness, self._damping, self._ee_pose, self._reference_pose, self._reference_twist)
        self.publishers = (self._scalars_publisher, *(sender.publisher for sender in (*senders, *self._joints)))
        self._last_status: tuple[bool, tuple[int, ...]] | None = None
        self._each_second = OnceEvery(DIAGNOSTICS_PERIOD_NS, LAW_PHASE)

    def publish(self, result: CycleResult) -> None:
        """Publish what is due in this cycle."""
        stamp_ns = result.joint.stamp_ns
        if result.cycle % self._decimation == 0:
            scalars = result.scalars()
            mode, speed = float(result.mode), result.path_speed
            self._publish_scalars(stamp_ns, scalars | {"mode": mode, "path_speed": speed})
            record = result.record
            for sender in self._joints:
                joints, n = record.joints, self._joint_count
                sender.send(stamp_ns, joints.position[:n], joints.velocity[:n], joints.disturbance[:n])
            if record.evaluated:
                self._publish_poses(stamp_ns, result, record, scalars)
        status = (result.ok, result.reason_key)
        if self._each_second.due(stamp_ns) or status != self._last_status:
            self._last_status = status
            self._publish_status(stamp_ns, result)

    def _publish_status(self, stamp_ns: int, result: CycleResult) -> None:
        record = result.record
        near = [name for name in ("arm", "attitude") if record.evaluated and record.law[f"near_singular_{name}"]]
        saturated = int(record.saturated.sum())
        level = ERROR if not result.ok else WARN if near or saturated else OK
        values = {
            "cycle": result.cycle,
            "load": result.load_source,
            "near_singular": ", ".join(near),
            "saturated_joints": saturated,
        }
        text = result.reason or ("ok" if result.ok else "bridged")
        self._status.publish(stamp_ns, f"{self._name}: law", level, text, values)

    def _publish_scalars(self, stamp_ns: int, values: Mapping[str, float]) -> None:
        if self._scalars is None:  # the names are the same in every cycle, and known with the first
            self._scalars = Sender(self._scalars_publisher, forms.scalars(tuple(values)))
        self._scalars.send(stamp_ns, tuple(values.values()))

    def _publish_poses(self, stamp_ns: int, result: CycleResult, record: Any, scalars: Mapping[str, float]) -> None:
        self._stiffness.send(stamp_ns, [scalars[f"K_{axis}"] for axis in AXES])
        self._damping.send(stamp_ns, [scalars[f"D_{axis}"] for axis in AXES])
        arm, reference = result.arm, record.reference
        self._ee_pose.send(stamp_ns, to_msgs.pose_numbers(arm.position, arm.rotation))
        self._reference_pose.send(stamp_ns, to_msgs.pose_numbers(reference.position, reference.rotation))
        self._reference_twist.send(stamp_ns, reference.twist)


class TimingPublisher:
    """Publishes how every cycle went in time, and a status about once a second.

    Args:
        node: owner of the publisher.
        params: of the controller.
        status: the arm's publisher of /diagnostics.
    """

    def __init__(self, node: Any, params: ControllerNodeParams, status: StatusPublisher) -> None:
        self._timing = CycleTiming(params.control_period_s)
        self._name = node.get_fully_qualified_name().removeprefix("/")
        self._numbers = create_sender(node, "controller/timing", forms.scalars(SCALARS))
        self.publishers = (self._numbers.publisher,)
        self._status = status
        self._each_second = OnceEvery(DIAGNOSTICS_PERIOD_NS, TIMING_PHASE)

    @property
    def missed(self) -> int:
        """Joint states that were never answered."""
        return self._timing.missed

    def publish(self, began_ns: int, ledger: Sequence[int]) -> None:
        """Take a cycle whose effort has just been published; `began_ns` is steady time, `ledger` what it used."""
        now_ns, wall_ns = time.monotonic_ns(), time.time_ns()
        numbers = self._timing.add(began_ns, now_ns, wall_ns, ledger)
        self._numbers.send(wall_ns, numbers)
        if self._each_second.due(wall_ns):
            level, text, values = self._timing.status()
            self._status.publish(wall_ns, f"{self._name}: timing", level, text, values)
