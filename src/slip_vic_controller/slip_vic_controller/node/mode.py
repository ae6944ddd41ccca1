"""The mode to the outside: topic, /diagnostics, services, and who else publishes on our topics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

from rclpy.clock import Clock, ClockType
from std_srvs.srv import Trigger

from slip_msgs_py.events import emit
from slip_msgs_py.fast_io import Refusals
from slip_msgs_py.messages import to_msgs
from slip_msgs_py.node_shell import OnceEvery
from slip_msgs_py.qos import create_publisher
from slip_vic_controller.node.publishing import DIAGNOSTICS_PERIOD_NS, MODE_PHASE, StatusPublisher
from slip_vic_controller.safety.modes import Mode, Request
from slip_vic_controller.session.arm_session import ArmSession
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.session.incidents import IncidentWatch
from slip_vic_controller.session.session import ControllerSession

PUBLISHERS_PERIOD_S = 0.02  # so long a foreign command may go unseen; a look takes some 30 us
GO_ON = "; to continue call ~/reset_fault, then ~/enable"
ENABLE = "; to continue call ~/enable"
LEVELS = {Mode.ACTIVE: 0, Mode.DEGRADED: 1, Mode.HOLD: 1, Mode.WAITING_INPUT: 1, Mode.FAULT: 2}


class RequestServices:
    """Takes requests for a mode, of all arms together.

    Args:
        node: owner of the services.
        session: what takes the requests.
    """

    def __init__(self, node: Any, session: ControllerSession) -> None:
        self._session = session
        for name, request in (
            ("enable", Request.ENABLE),
            ("hold", Request.HOLD),
            ("reset_fault", Request.RESET_FAULT),
            ("tare", Request.TARE),
        ):
            node.create_service(Trigger, f"~/{name}", lambda _, response, r=request: self._on_request(r, response))

    def _on_request(self, request: Request, response: Any) -> Any:
        faulty = next((arm for arm in self._session.arms if arm.mode == Mode.FAULT), None)
        if not self._session.active:
            response.success, response.message = False, "not active"
        elif faulty is not None and request != Request.RESET_FAULT:
            response.success, response.message = False, f"in FAULT: {faulty.reason}{GO_ON}"
        elif request == Request.TARE and any(arm.mode.follows for arm in self._session.arms):
            response.success, response.message = False, "the law is at work: call ~/hold first"
        elif request == Request.TARE and not all(arm.controller.params.tare.duration_s for arm in self._session.arms):
            response.success, response.message = False, "tare.duration_s is 0: sensors are used as they are"
        else:
            self._session.request(request)
            response.success, response.message = True, f"{request.name.lower()}: decided in the next cycle"
        return response


class ModeInterface:
    """Publishes the mode of an arm where it changes.

    Args:
        node: owner of topic and timer.
        arm: whose mode it is.
        refusals: messages that could not be read, for the report.
        status: the arm's publisher of /diagnostics.
    """

    def __init__(self, node: Any, arm: ArmSession, refusals: Refusals, status: StatusPublisher) -> None:
        self._node, self._arm = node, arm
        self._refusals = refusals
        self._status = status
        self._topic = create_publisher(node, "controller/mode")
        self._last: tuple[Mode, tuple[int, ...], str] | None = None
        self._incidents = IncidentWatch()
        self._each_second = OnceEvery(DIAGNOSTICS_PERIOD_NS, MODE_PHASE)
        self._command_topic = ""
        self._inputs: tuple[Any, ...] = ()

    def watch(self, command_topic: str, inputs: Sequence[Any]) -> None:
        """Look from time to time who publishes on our command topic and on what our subscriptions take."""
        self._command_topic, self._inputs = command_topic, tuple(inputs)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._node.create_timer(PUBLISHERS_PERIOD_S, self._look_for_publishers, clock=steady)
        self._look_for_publishers()

    def publish(self, result: CycleResult) -> None:
        """Publish what has changed, and the status about once a second of the joint state's clock."""
        mode, stamp_ns = result.mode, result.joint.stamp_ns
        go_on = GO_ON if mode == Mode.FAULT else ENABLE if mode == Mode.HOLD and not result.record.mode.enabled else ""
        now = (mode, result.reason_key, go_on)
        if not self._each_second.due(stamp_ns) and now == self._last:
            return
        incident = self._incidents.see(result)
        if incident is not None:
            name = self._arm.name
            emit("incident", **asdict(replace(incident, text=f"{name}: {incident.text}") if name else incident))
        reason = result.reason + go_on
        if now != self._last:
            line = f"{mode.name}: {reason}" if reason else mode.name
            self._topic.publish(to_msgs.string(line))
            if self._last is None or mode != self._last[0]:
                self._log(mode, line)
        self._last = now
        name = f"{self._node.get_fully_qualified_name().removeprefix('/')}: mode"
        text = reason or mode.name
        self._status.publish(stamp_ns, name, LEVELS[mode], text, self._values(result))

    def _log(self, mode: Mode, line: str) -> None:
        """Write a change of mode to the ROS log; another reason for the same mode is on the topic alone."""
        name = self._arm.name
        log, line = self._node.get_logger(), f"{name}: {line}" if name else line
        if LEVELS[mode] == 0:
            log.info(line)
        elif LEVELS[mode] == 1:
            log.warning(line)
        else:
            log.error(line)

    def _values(self, result: CycleResult) -> dict[str, object]:
        values = {"mode": result.mode.name, **result.reason_fields}
        refused = {f"{name} refused": count for name, count in self._refusals.counts.items()}
        return values | self._arm.counts() | refused

    def _look_for_publishers(self) -> None:
        # Counting is quick; who they are takes a good part of a control period, and matters for two only.
        inputs = {item.topic_name: self._owners(item.topic_name, item.get_publisher_count()) for item in self._inputs}
        # Whoever is on our command topic is foreign, also under our name: a process that starts sees no ghosts.
        self._arm.set_publishers(inputs, self._node.count_publishers(self._command_topic))

    def _owners(self, topic: str, publishers: int) -> int:
        """Return how many differently named nodes publish; a killed node's ghost lives on in discovery for a while."""
        if publishers < 2:
            return publishers
        infos = self._node.get_publishers_info_by_topic(topic)
        return len({(info.node_namespace, info.node_name) for info in infos})
