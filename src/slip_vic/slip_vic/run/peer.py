"""Topics and services for a command: it polls, its node is in no executor."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.srv import GetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message

from slip_bags.recorder import RawSubscription
from slip_core.errors import InputError, ProtocolError
from slip_core.topics import TOPICS
from slip_msgs_py.qos import message_class


class Listener(RawSubscription):
    """The messages of a topic; name: as in the table of topics, full: as it is called here."""

    def __init__(self, node: Node, name: str, full: str, profile: QoSProfile) -> None:
        super().__init__(node, message_class(TOPICS[name].type), full, profile)
        self.newest: Any = None

    def take(self) -> list[tuple[int, Any]]:
        """Return the messages that have arrived, each with the time of its arrival [ns]."""
        return [(one.log_time_ns, deserialize_message(one.value, self.kind)) for one in self.drain()]

    def see(self) -> bool:
        """Decode only the newest message, into `newest`; return whether one has arrived."""
        last = deque(self.drain(), maxlen=1)
        if last:
            self.newest = deserialize_message(last[0].value, self.kind)
        return bool(last)


class Asker:
    """Calls services by a node of its own, whose executor takes no message of another one."""

    def __init__(self, node: Node) -> None:
        self._node = Node(f"{node.get_name()}_ask", context=node.context, start_parameter_services=False)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(self._node)
        self._clients: dict[str, Any] = {}

    def call(self, kind: type, service: str, request: object, seconds: float) -> Any:
        """Return the answer.

        Raises:
            InputError: no node has the service; ProtocolError: it does not answer in time.
        """
        client = self._clients.get(service) or self._clients.setdefault(
            service, self._node.create_client(kind, service)
        )
        if not client.wait_for_service(seconds):
            raise InputError(
                f"node {service.rpartition('/')[0]}", got="no answer", expected="a node that runs",
                fix="start it first; compare --namespace and ROS_DOMAIN_ID",
            )  # fmt: skip
        future = client.call_async(request)
        self._executor.spin_until_future_complete(future, timeout_sec=seconds)
        if future.result() is None:
            raise ProtocolError(f"{service} did not answer within {seconds:g} s")
        return future.result()

    def parameters(self, node: str, names: Sequence[str], seconds: float) -> dict[str, Any]:
        """Return the parameters of these names that a node has, by name; raises as `call` does."""
        answer = self.call(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=[*names]), seconds)
        values = zip(names, map(parameter_value_to_python, answer.values), strict=True)
        return {name: list(v) if hasattr(v, "typecode") else v for name, v in values if v is not None}
