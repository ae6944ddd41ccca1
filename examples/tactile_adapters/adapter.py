"""python examples/tactile_adapters/adapter.py papillarray|xela|bool [--ros-args ...]: tactile sensors to our topics.

Each adapter subscribes to a vendor's topic and publishes what the controller reads.

Remap `slip_flag`, `wrench` and the vendor's topic as usual. A message without a header is stamped when it arrives; tell
the controller with `slip_delay_s` by how much that is late.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from geometry_msgs.msg import Vector3, Wrench, WrenchStamped
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_msgs_py.executor import Spinner
from slip_msgs_py.node_main import run_node
from slip_msgs_py.stop_flag import StopFlag

sys.path.insert(0, str(Path(__file__).parent))
from conversions import papillarray_flags, papillarray_wrench, taxel_places, xela_wrench

DEPTH = 10
STOP_WITHIN_S = 0.1
PAPILLARRAY = "sensor_interfaces", "SensorState", "Contactile's ROS 2 driver"
XELA = "xela_server_ros2", "SensStream", "XELA's ROS 2 server"


def message_type(package: str, name: str, source: str) -> Any:
    """Return a vendor's message class.

    Raises:
        InputError: its package is not installed here.
    """
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError):
        raise InputError(
            f"message {package}/msg/{name}", got="no such package here", expected=f"the messages of {source}",
            fix="build its workspace and source its setup file in this terminal",
        ) from None  # fmt: skip


class Adapter(Node):
    """Base of the adapters: publishers, and one line where a message cannot be used."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._said = ""

    def take(self, kind: Any, topic: str, use: Callable[[Any], None]) -> None:
        """Subscribe to a vendor's topic, best effort."""

        def guarded(message: Any) -> None:
            try:
                use(message)
            except InputError as error:
                if str(error) != self._said:
                    self._said = str(error)
                    self.get_logger().error(self._said)

        self.create_subscription(kind, topic, guarded, qos_profile_sensor_data)

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Convert messages until it is to stop."""
        executor = EventsExecutor()
        executor.add_node(self)
        Spinner(executor).spin_while(self, lambda: not should_stop(), STOP_WITHIN_S)

    def header(self, message: Any) -> Any:
        """Return the message's header, or one with the time of now."""
        return getattr(message, "header", None) or Header(stamp=self.get_clock().now().to_msg())


def flags(header: Any, values: dict[str, float]) -> JointState:
    """Return flags as the controller reads them."""
    return JointState(header=header, name=list(values), position=list(values.values()))


def wrench(header: Any, six: Array) -> WrenchStamped:
    """Return a wrench; (6,) [N, N m]."""
    x, y, z, rx, ry, rz = six.tolist()
    return WrenchStamped(header=header, wrench=Wrench(force=Vector3(x=x, y=y, z=z), torque=Vector3(x=rx, y=ry, z=rz)))


class PapillArray(Adapter):
    """PapillArray's SensorState on `sensor_state` to `slip_flag` and `wrench`."""

    def __init__(self) -> None:
        kind = message_type(*PAPILLARRAY)
        super().__init__("slip_adapter_papillarray")
        self._flag = self.create_publisher(JointState, "slip_flag", DEPTH)
        self._wrench = self.create_publisher(WrenchStamped, "wrench", DEPTH)
        self.take(kind, "sensor_state", self._use)

    def _use(self, message: Any) -> None:
        self._flag.publish(flags(message.header, papillarray_flags(message)))
        self._wrench.publish(wrench(message.header, papillarray_wrench(message)))


class Xela(Adapter):
    """One sensor of XELA's SensStream on `xServTopic` to `wrench`; parameters: sensor, rows, columns, pitch_m."""

    def __init__(self) -> None:
        kind = message_type(*XELA)
        super().__init__("slip_adapter_xela")
        given = {name: self.declare_parameter(name, value).value for name, value in _GRID.items()}
        self._sensor = given["sensor"]
        self._places = taxel_places(given["rows"], given["columns"], given["pitch_m"])
        self._wrench = self.create_publisher(WrenchStamped, "wrench", DEPTH)
        self.take(kind, "xServTopic", self._use)

    def _use(self, message: Any) -> None:
        self._wrench.publish(wrench(self.header(message), xela_wrench(message, self._sensor, self._places)))


class Boolean(Adapter):
    """std_msgs/Bool on `slipping` to `slip_flag`, stamped when it arrives: a Bool has no stamp of its own."""

    def __init__(self) -> None:
        super().__init__("slip_adapter_bool")
        self._flag = self.create_publisher(JointState, "slip_flag", DEPTH)
        self.take(Bool, "slipping", self._use)

    def _use(self, message: Any) -> None:
        self._flag.publish(flags(self.header(message), {"slip": float(message.data)}))


_GRID: dict[str, Any] = {"sensor": 1, "rows": 4, "columns": 4, "pitch_m": 4.7e-3}


ADAPTERS = {"papillarray": PapillArray, "xela": Xela, "bool": Boolean}


def main(arguments: list[str]) -> int:
    """Run the adapter that the first argument names; the others are for ROS."""
    if len(arguments) < 2 or arguments[1] not in ADAPTERS:
        print(f"usage: adapter.py {'|'.join(ADAPTERS)} [--ros-args ...]", file=sys.stderr)
        return 2
    StopFlag().install()
    return run_node(ADAPTERS[arguments[1]])


if __name__ == "__main__":
    sys.exit(main(sys.argv))
