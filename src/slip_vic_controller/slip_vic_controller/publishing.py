"""Publishes the law's inside as stock messages that plotting tools show by name."""

from __future__ import annotations

from typing import Any

from slip_msgs_py import to_msgs
from slip_msgs_py.qos import create_publisher
from slip_vic_controller.core.diagnostics import TickDiagnostics

DIAGNOSTICS_PERIOD_NS = 1_000_000_000
OK, WARN, ERROR = 0, 1, 2


class DiagnosticsPublisher:
    """Publishers of the diagnostic topics; every `decimation`-th cycle, and /diagnostics about once a second.

    Args:
        node: owner of the publishers.
        decimation: how many cycles per publication.
    """

    def __init__(self, node: Any, decimation: int) -> None:
        self._decimation = decimation
        self._name = node.get_name()
        self._scalars = create_publisher(node, "controller/scalars")
        self._stiffness = create_publisher(node, "controller/stiffness")
        self._damping = create_publisher(node, "controller/damping")
        self._ee_pose = create_publisher(node, "controller/ee_pose")
        self._reference_pose = create_publisher(node, "controller/reference_pose")
        self._reference_twist = create_publisher(node, "controller/reference_twist")
        self._status = create_publisher(node, "/diagnostics")
        self.publishers = (
            self._scalars,
            self._stiffness,
            self._damping,
            self._ee_pose,
            self._reference_pose,
            self._reference_twist,
        )
        self._last_status: tuple[str, str] | None = None
        self._last_status_ns = 0

    def publish(self, cycle: int, stamp_ns: int, record: TickDiagnostics) -> None:
        """Publish what is due in this cycle."""
        if cycle % self._decimation == 0:
            self._scalars.publish(to_msgs.scalars(record.scalars(), stamp_ns))
            if record.terms is not None:
                self._publish_terms(stamp_ns, record)
        status = (record.status, record.reason)
        if status != self._last_status or stamp_ns - self._last_status_ns >= DIAGNOSTICS_PERIOD_NS:
            self._last_status, self._last_status_ns = status, stamp_ns
            level = ERROR if record.status != "ok" else WARN if record.near_singular or record.saturated.any() else OK
            values = {
                "cycle": cycle,
                "near_singular": ", ".join(record.near_singular),
                "saturated_joints": int(record.saturated.sum()),
            }
            text = record.reason or record.status
            self._status.publish(to_msgs.diagnostics(stamp_ns, f"{self._name}: law", level, text, values))

    def _publish_terms(self, stamp_ns: int, record: TickDiagnostics) -> None:
        terms = record.terms
        if terms is None:
            return
        self._stiffness.publish(to_msgs.six_as_wrench(terms.law.K, stamp_ns, to_msgs.WORLD))
        self._damping.publish(to_msgs.six_as_wrench(terms.law.D, stamp_ns, to_msgs.WORLD))
        self._ee_pose.publish(to_msgs.pose_stamped(terms.arm.position, terms.arm.rotation, stamp_ns))
        reference = terms.reference
        self._reference_pose.publish(to_msgs.pose_stamped(reference.position, reference.rotation, stamp_ns))
        self._reference_twist.publish(to_msgs.twist_stamped(reference.twist, stamp_ns, to_msgs.WORLD))
