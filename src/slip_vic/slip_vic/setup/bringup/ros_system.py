"""The system of a bring-up over DDS: the controller's inputs, topics and services."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeVar

import numpy as np
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from slip_core.arrays import Array
from slip_core.errors import InputError, ProtocolError
from slip_core.files.urdf_file import arm_urdf
from slip_core.params import ParameterModel, build, parameter_infos
from slip_core.stamps import stamp_to_ns
from slip_core.topics import TOPICS
from slip_msgs_py.messages import to_msgs
from slip_msgs_py.messages.from_msgs import joint_indices, vector6
from slip_msgs_py.node_shell import NodePart
from slip_msgs_py.qos import create_publisher
from slip_vic.run.peer import Asker, Listener
from slip_vic.setup.bringup.heard import SCALARS, Heard, Status, Track
from slip_vic_controller.params.controller_params import ControllerParams

Params = TypeVar("Params", bound=ParameterModel)
CONTROLLER: Final = "slip_vic_controller"
INPUTS: Final = ("joint_states", "wrench", "slip_velocity")
ANSWER_S: Final = 10.0
DISCOVERY_S: Final = 20.0
SILENCE_S: Final = 3.0
POLL_S: Final = 0.005
DEPTH: Final = 4000


class RosSystem:
    """A running controller with its drivers.

    Args:
        node: in no executor; its subscriptions are polled.
        namespace: of the controller.

    Raises:
        InputError: there is no controller, or it has no URDF.
    """

    def __init__(self, node: Node, namespace: str) -> None:
        self._asker = Asker(node)
        self._node, self._ns = node, f"/{namespace.strip('/')}".rstrip("/")
        self.params = self.parameters(ControllerParams)
        self.urdf = arm_urdf(self.params)
        if self._state() == State.PRIMARY_STATE_UNCONFIGURED:
            self._change(Transition.TRANSITION_CONFIGURE)
        self._inputs = {name: self._subscribe(name, full) for name, full in self._find_inputs().items()}
        self._inputs["controller/scalars"] = self._subscribe("controller/scalars")
        self._status = Status()
        self._said = self._subscribe("controller/goal", latched=True)
        self._diagnostics = self._subscribe("/diagnostics", "/diagnostics")
        self._goals = create_publisher(NodePart(node, f"{self._ns}/"), "goal")
        self._until(lambda: self._goals.get_subscription_count() > 0)
        self._until(lambda: bool(self.status.mode))  # an inactive controller has not published one yet

    @property
    def status(self) -> Status:
        """The newest mode, by the fields of /diagnostics."""
        name = f"{self._ns}/{CONTROLLER}: mode".removeprefix("/")
        for _, message in self._diagnostics.take():
            for status in message.status:
                if status.name == name:
                    values = {field.key: field.value for field in status.values}
                    self._status = Status(values["mode"], status.message)
        return self._status

    @property
    def goal(self) -> str:
        """The newest text of `controller/goal`."""
        self._said.see()
        return "" if self._said.newest is None else str(self._said.newest.data)

    def listen(self, seconds: float, begin: Callable[[], None] = lambda: None) -> Heard:
        """Return the messages until the joint states' stamps are `seconds` later, or until they stay away.

        begin: runs first; the seconds count from its end, and messages that arrive during it are included.
        """
        for subscription in self._inputs.values():
            subscription.take()
        begin()
        heard: dict[str, list[tuple[int, Any]]] = {name: [] for name in self._inputs}
        last, since_ns = time.monotonic(), None
        while time.monotonic() - last < SILENCE_S:
            time.sleep(POLL_S)
            for name, subscription in self._inputs.items():
                heard[name] += (fresh := subscription.take())
                if fresh and name == "joint_states":
                    last, now_ns = time.monotonic(), _stamp_ns(fresh[-1])
                    since_ns = now_ns if since_ns is None else since_ns
                    if now_ns - since_ns >= 1e9 * seconds:
                        return self._read(heard)
        return self._read(heard)

    def set_active(self, active: bool) -> None:
        """Activate or deactivate the controller."""
        if self._state() == (State.PRIMARY_STATE_INACTIVE if active else State.PRIMARY_STATE_ACTIVE):
            self._change(Transition.TRANSITION_ACTIVATE if active else Transition.TRANSITION_DEACTIVATE)

    def ask(self, request: str, node: str = CONTROLLER) -> None:
        """Call a service without arguments.

        Raises:
            ProtocolError: it refuses.
        """
        answer = self._call(Trigger, f"{node}/{request}", Trigger.Request())
        if not answer.success:
            raise ProtocolError(f"{self._ns}/{node}/{request}: {answer.message}")

    def tune(self, values: Mapping[str, Any], node: str = CONTROLLER) -> None:
        """Set parameters.

        Raises:
            ProtocolError: one is refused.
        """
        wanted = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        answer = self._call(SetParameters, f"{node}/set_parameters", SetParameters.Request(parameters=wanted))
        for result in answer.results:
            if not result.successful:
                raise ProtocolError(f"{self._ns}/{node}: {result.reason}")

    def parameters(self, model: type[Params], node: str = CONTROLLER) -> Params:
        """Return all parameters of a node.

        Raises:
            InputError: there is no such node.
        """
        names = [info.name for info in parameter_infos(model)]
        return build(model, self._asker.parameters(f"{self._ns}/{node}", names, ANSWER_S), node)

    def send_goal(self, position: Array, rotation: Array, duration_s: float) -> None:
        """Publish a goal."""
        self._goals.publish(to_msgs.goal(position, rotation, duration_s))

    # -- topics ------------------------------------------------------------------------------------

    def _find_inputs(self) -> dict[str, str]:
        """Return the full names of the inputs, as the controller has them by remapping."""
        wanted = [name for name in INPUTS if name != "wrench" or self.params.wrench.source == "sensor"]
        found: dict[str, str] = {}

        def subscribed() -> bool:
            try:
                known = self._node.get_subscriber_names_and_types_by_node(CONTROLLER, self._ns or "/")
            except NodeNameNonExistentError:  # discovered later than its services
                return False
            for name in wanted:
                names = [full for full, kinds in known if TOPICS[name].type in kinds]
                same = [full for full in names if full.endswith(f"/{name}")]
                others = [full for full in names if full.rpartition("/")[2] not in wanted]
                if same + others:
                    found[name] = (same + others)[0]
            return len(found) == len(wanted)

        if not self._until(subscribed):
            raise InputError(
                f"controller {self._ns}/{CONTROLLER}", got=f"no subscription to {', '.join(set(wanted) - set(found))}",
                expected="a controller that is configured", fix="see its log",
            )  # fmt: skip
        return found

    def _subscribe(self, name: str, full: str = "", *, latched: bool = False) -> Listener:
        qos = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
        if latched:
            qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        return Listener(self._node, name, full or f"{self._ns}/{name}", qos)

    def _read(self, heard: Mapping[str, list[tuple[int, Any]]]) -> Heard:
        joints = heard["joint_states"]
        received = np.maximum.accumulate([at_ns for at_ns, _ in joints]) if joints else np.empty(0)
        stamps = 1e-9 * np.array([_stamp_ns(one) for one in joints])

        def track(name: str, columns: int, numbers: Callable[[Any], Array | list[float]]) -> Track:
            found = heard.get(name, [])
            if not found or not joints:
                return Track(np.empty(0), np.empty(0), np.empty((0, columns)))
            before = np.searchsorted(received, [at_ns for at_ns, _ in found], side="right") - 1
            values = np.array([numbers(message) for _, message in found])
            return Track(stamps[np.maximum(before, 0)], 1e-9 * np.array([_stamp_ns(one) for one in found]), values)

        def states(message: JointState) -> list[float]:
            pick = joint_indices(self.params.joint_names, tuple(message.name))
            return [values[i] for values in (message.position, message.velocity) for i in pick]

        def scalars(message: JointState) -> list[float]:
            known = dict(zip(message.name, message.position, strict=True))
            return [known.get(name, np.nan) for name in SCALARS]

        return Heard(
            track("joint_states", 2 * len(self.params.joint_names), states),
            track("wrench", 6, lambda message: vector6(message.wrench.force, message.wrench.torque)),
            track("slip_velocity", 6, lambda message: vector6(message.twist.linear, message.twist.angular)),
            track("controller/scalars", len(SCALARS), scalars),
        )

    def _until(self, done: Callable[[], bool]) -> bool:
        end = time.monotonic() + DISCOVERY_S
        while not (held := done()) and time.monotonic() < end:
            time.sleep(POLL_S)
        return held

    # -- services ----------------------------------------------------------------------------------

    def _state(self) -> int:
        return int(self._call(GetState, f"{CONTROLLER}/get_state", GetState.Request()).current_state.id)

    def _change(self, transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        if not self._call(ChangeState, f"{CONTROLLER}/change_state", request).success:
            raise ProtocolError(f"{self._ns}/{CONTROLLER} refuses the lifecycle transition {transition}: see its log")

    def _call(self, kind: type, service: str, request: object) -> Any:
        """Call a service of a node, as `Asker.call` does."""
        return self._asker.call(kind, f"{self._ns}/{service}", request, ANSWER_S)


def _stamp_ns(taken: tuple[int, Any]) -> int:
    return stamp_to_ns(taken[1].header.stamp)
