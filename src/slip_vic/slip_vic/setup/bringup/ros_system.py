"""The system of a bring-up over DDS: listens to what the controller listens to, and calls its services."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from slip_bags.recording.raw_subscription import Arrival, RawSubscription, recording_qos
from slip_core.arrays import Array
from slip_core.errors import InputError, ProtocolError
from slip_core.files.urdf_file import read_urdf
from slip_core.params import build, parameter_infos
from slip_core.stamps import stamp_of
from slip_core.topics import TOPICS
from slip_msgs_py.messages import to_msgs
from slip_msgs_py.messages.from_msgs import JointOrder, vector6
from slip_msgs_py.qos import create_publisher, message_class
from slip_vic.setup.bringup.verdicts import Endpoint, Heard, Track
from slip_vic_controller.params.node_params import ControllerNodeParams

CONTROLLER: Final = "slip_vic_controller"
BRIDGE: Final = "slip_sim_bridge"
ANSWER_S: Final = 10.0
DISCOVERY_S: Final = 20.0  # on a busy machine; what is there is there at once
SILENCE_S: Final = 3.0
LOOK_S: Final = 0.005
DEPTH: Final = 4000
SLIP: Final = {"twist": "slip_velocity", "displacement": "slip_displacement", "flag": "slip_flag"}
SCALARS: Final = ("friction_limit", "load_commanded", "friction_events", "slipping")


class RosSystem:
    """A controller that runs, with its drivers.

    Args:
        node: in no executor.
        namespace: of the controller.

    Raises:
        InputError: there is no controller, or it has no URDF.
    """

    def __init__(self, node: Node, namespace: str) -> None:
        self._node, self._ns = node, f"/{namespace.strip('/')}".rstrip("/")
        self._asker = Node("slip_vic_bringup_ask", context=node.context, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(self._asker)
        self._clients: dict[str, Any] = {}
        self._texts = {"controller/mode": "", "controller/goal": ""}
        names = [info.name for info in parameter_infos(ControllerNodeParams)]
        self.params = build(ControllerNodeParams, self._parameters(CONTROLLER, names), CONTROLLER)
        self.urdf = self.params.robot_description or read_urdf(
            self.params.robot_description_file, "parameter robot_description_file"
        )
        if self._state() == State.PRIMARY_STATE_UNCONFIGURED:
            self._change(Transition.TRANSITION_CONFIGURE)
        self._slip = SLIP[self.params.slip_input]
        self._wrench = ("wrench",) if self.params.wrench.source == "sensor" else ()
        self._names = self._find_inputs()
        self._inputs = {name: self._subscribe(name, full) for name, full in self._names.items()}
        self._scalars = self._subscribe("controller/scalars", f"{self._ns}/controller/scalars")
        self._latched = {name: self._subscribe(name, f"{self._ns}/{name}") for name in self._texts}
        self._goals = create_publisher(node, "goal", actual_name=f"{self._ns}/goal")
        self._order = JointOrder(self.params.joint_names)
        self._until(lambda: self._goals.get_subscription_count() > 0)
        self._until(lambda: bool(self.mode))  # there is none yet where the controller has not begun

    def close(self) -> None:
        """Take everything down."""
        self._executor.shutdown()
        self._asker.destroy_node()

    @property
    def mode(self) -> str:
        """The newest text of `controller/mode`."""
        return self._newest("controller/mode")

    @property
    def goal(self) -> str:
        """The newest text of `controller/goal`."""
        return self._newest("controller/goal")

    def look(self) -> tuple[Endpoint, ...]:
        """Return how the inputs are found, with a first message of each where one comes."""
        self._until(lambda: all(self._node.count_publishers(full) for full in self._names.values()))
        first: dict[str, Any] = {}

        def complete() -> bool:
            for name, subscription in self._inputs.items():
                for arrival in subscription.drain():
                    first[name] = deserialize_message(arrival.data, message_class(TOPICS[name].type))
            return len(first) == len(self._inputs)

        self._until(complete)
        frames = {"wrench": self.params.wrench.frame or self.params.ee_frame, "slip_velocity": self.params.ee_frame}
        found = []
        for name, full in self._names.items():
            infos, message = self._node.get_publishers_info_by_topic(full), first.get(name)
            found.append(
                Endpoint(
                    full, len(infos), tuple(sorted({info.topic_type for info in infos})), TOPICS[name].type,
                    frame="" if message is None else message.header.frame_id, wanted_frame=frames.get(name, ""),
                    names=tuple(message.name) if name == "joint_states" and message is not None else (),
                )
            )  # fmt: skip
        return tuple(found)

    def listen(self, seconds: float, begin: Callable[[], None] = lambda: None) -> Heard:
        """Return what comes until the joint states' stamps are `seconds` later, or for so long that nothing comes.

        begin: what is done first; the seconds count from its end, and what comes meanwhile is heard too.
        """
        all_of = {**self._inputs, "controller/scalars": self._scalars}
        heard: dict[str, list[Arrival]] = {name: [] for name in all_of}
        for subscription in all_of.values():
            for _ in subscription.drain():
                pass  # what was before
        begin()
        last, since_s = time.monotonic(), None
        while time.monotonic() - last < SILENCE_S:
            time.sleep(LOOK_S)
            for name, subscription in all_of.items():
                fresh = list(subscription.drain())
                heard[name] += fresh
                if fresh and name == "joint_states":
                    last = time.monotonic()
                    now_s = _time_of(fresh[-1])
                    since_s = now_s if since_s is None else since_s
                    if now_s - since_s >= seconds:
                        return self._read(heard)
        return self._read(heard)

    def set_active(self, active: bool) -> None:
        """Activate or deactivate the controller."""
        state = self._state()
        if active and state == State.PRIMARY_STATE_INACTIVE:
            self._change(Transition.TRANSITION_ACTIVATE)
        elif not active and state == State.PRIMARY_STATE_ACTIVE:
            self._change(Transition.TRANSITION_DEACTIVATE)

    def ask(self, request: str) -> None:
        """Call the controller's service.

        Raises:
            ProtocolError: it refuses.
        """
        self._trigger(f"{CONTROLLER}/{request}")

    def tune(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the controller."""
        self._set(CONTROLLER, values)

    def send_goal(self, position: Array, rotation: Array, duration_s: float) -> None:
        """Publish a goal."""
        from builtin_interfaces.msg import Duration
        from geometry_msgs.msg import Transform
        from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

        turned = to_msgs.pose(to_msgs.pose_numbers(position, rotation)).orientation
        pose = Transform(translation=to_msgs.vector3(position), rotation=turned)
        seconds, rest = divmod(round(1e9 * duration_s), 10**9)
        after = Duration(sec=seconds, nanosec=rest)
        self._goals.publish(
            MultiDOFJointTrajectory(points=[MultiDOFJointTrajectoryPoint(transforms=[pose], time_from_start=after)])
        )

    def tune_bridge(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the simulated arm."""
        self._set(BRIDGE, values)

    def reset_bridge(self) -> None:
        """Put the simulated arm back."""
        self._trigger(f"{BRIDGE}/reset")

    def bridge_parameters(self, names: list[str]) -> dict[str, Any]:
        """Return parameters of the simulated arm.

        Raises:
            InputError: there is none.
        """
        return self._parameters(BRIDGE, names)

    # -- topics ------------------------------------------------------------------------------------

    def _find_inputs(self) -> dict[str, str]:
        """Return the full names of the inputs, as the controller has them by remapping."""
        wanted = ("joint_states", *self._wrench, self._slip)
        found: dict[str, str] = {}

        def subscribed() -> bool:
            try:
                known = self._node.get_subscriber_names_and_types_by_node(CONTROLLER, self._ns or "/")
            except NodeNameNonExistentError:  # its services are known sooner than its name
                return False
            for name in wanted:
                names = [full for full, kinds in known if TOPICS[name].type in kinds]
                same = [full for full in names if full.endswith(f"/{name}")]
                others = [full for full in names if full.rpartition("/")[2] not in wanted]
                found.update({name: full} if (full := next(iter(same + others), "")) else {})
            return len(found) == len(wanted)

        if not self._until(subscribed):
            raise InputError(
                f"controller {self._ns}/{CONTROLLER}", got=f"no subscription to {', '.join(set(wanted) - set(found))}",
                expected="a controller that is configured", fix="see its log",
            )  # fmt: skip
        return found

    def _subscribe(self, name: str, full: str) -> RawSubscription:
        latched = name in self._texts
        qos = recording_qos(1 if latched else DEPTH, reliable=latched, transient_local=latched)
        return RawSubscription(self._node, message_class(TOPICS[name].type), full, qos)

    def _newest(self, name: str) -> str:
        for arrival in self._latched[name].drain():
            self._texts[name] = deserialize_message(arrival.data, message_class(TOPICS[name].type)).data
        return self._texts[name]

    def _read(self, heard: Mapping[str, list[Arrival]]) -> Heard:
        joints = heard["joint_states"]
        received = np.array([arrival.received_ns for arrival in joints])
        stamps = np.array([_time_of(arrival) for arrival in joints])

        def track(name: str, columns: int, numbers: Callable[[Any], Array | list[float]]) -> Track:
            found = heard.get(name)
            if not found or not len(stamps):
                return Track(np.empty(0), np.empty(0), np.empty((0, columns)))
            before = np.searchsorted(received, [arrival.received_ns for arrival in found], side="right") - 1
            kind = message_class(TOPICS[name].type)
            values = np.array([numbers(deserialize_message(arrival.data, kind)) for arrival in found])
            return Track(stamps[np.maximum(before, 0)], np.array([_time_of(one) for one in found]), values)

        def states(message: JointState) -> list[float]:
            pick = self._order.indices(message.name)
            return [values[i] for values in (message.position, message.velocity) for i in pick]

        def scalars(message: JointState) -> list[float]:
            known = dict(zip(message.name, message.position, strict=True))
            return [known.get(name, np.nan) for name in SCALARS]

        n = len(self.params.joint_names)
        slip: dict[str, Callable[[Any], Array | list[float]]] = {
            "twist": _twist, "displacement": _pose, "flag": lambda message: list(message.position),
        }  # fmt: skip
        rows = track("controller/scalars", len(SCALARS), scalars).values
        return Heard(
            track("joint_states", 2 * n, states), track("wrench", 6, _wrench),
            track(self._slip, 6, slip[self.params.slip_input]), dict(zip(SCALARS, rows.T, strict=True)),
        )  # fmt: skip

    def _until(self, done: Callable[[], bool]) -> bool:
        end = time.monotonic() + DISCOVERY_S
        while not done():
            if time.monotonic() > end:
                return False
            time.sleep(LOOK_S)
        return True

    # -- services ----------------------------------------------------------------------------------

    def _state(self) -> int:
        return int(self._call(GetState, f"{CONTROLLER}/get_state", GetState.Request()).current_state.id)

    def _change(self, transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        if not self._call(ChangeState, f"{CONTROLLER}/change_state", request).success:
            raise ProtocolError(f"{self._ns}/{CONTROLLER} refuses the lifecycle transition {transition}: see its log")

    def _trigger(self, service: str) -> None:
        answer = self._call(Trigger, service, Trigger.Request())
        if not answer.success:
            raise ProtocolError(f"{self._ns}/{service}: {answer.message}")

    def _set(self, node: str, values: Mapping[str, Any]) -> None:
        wanted = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        answer = self._call(SetParameters, f"{node}/set_parameters", SetParameters.Request(parameters=wanted))
        for result in answer.results:
            if not result.successful:
                raise ProtocolError(f"{self._ns}/{node}: {result.reason}")

    def _parameters(self, node: str, names: list[str]) -> dict[str, Any]:
        answer = self._call(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=names))
        values = ((name, parameter_value_to_python(value)) for name, value in zip(names, answer.values, strict=True))
        return {
            name: list(value) if hasattr(value, "typecode") else value for name, value in values if value is not None
        }

    def _call(self, kind: type, service: str, request: object) -> Any:
        """Call a service of a node.

        Raises:
            InputError: no node has it; ProtocolError: no answer.
        """
        full = f"{self._ns}/{service}"
        if full not in self._clients:
            self._clients[full] = self._asker.create_client(kind, full)
        client = self._clients[full]
        if not client.wait_for_service(ANSWER_S):
            raise InputError(
                f"node {full.rpartition('/')[0]}", got="no answer", expected="a node that runs",
                fix="start it first; look at --namespace and ROS_DOMAIN_ID",
            )  # fmt: skip
        future = client.call_async(request)
        self._executor.spin_until_future_complete(future, timeout_sec=ANSWER_S)
        if future.result() is None:
            raise ProtocolError(f"{full} did not answer within {ANSWER_S:g} s")
        return future.result()


def _time_of(arrival: Arrival) -> float:
    """Return the stamp [s] of a message that begins with a header."""
    return 1e-9 * stamp_of(arrival.data)


def _wrench(message: WrenchStamped) -> Array:
    return vector6(message.wrench.force, message.wrench.torque)


def _twist(message: TwistStamped) -> Array:
    return vector6(message.twist.linear, message.twist.angular)


def _pose(message: PoseStamped) -> list[float]:
    at, turned = message.pose.position, message.pose.orientation
    return [at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w]
