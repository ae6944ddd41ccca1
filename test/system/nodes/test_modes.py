"""The managed controller over DDS: lifecycle, services, mode topic, and what it does when others fall silent."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile

from slip_vic.scenarios.scenario import NODES, load, ros_parameter_file
from test.support.ros import DEADLINE_S, Processes, call_service, wait_until

ATTEMPTS, PATIENCE_S = 3, 8.0
BRIDGE, CONTROLLER = "slip_sim_bridge.main", "slip_vic_controller.main"
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Watcher:
    """Sees modes and commands of an arm, by the prefix of its topics, and calls services."""

    def __init__(self, node: Any, prefix: str = "") -> None:
        from sensor_msgs.msg import JointState
        from std_msgs.msg import String

        self.node = node
        self.modes: list[str] = []
        self.commands: list[Any] = []
        node.create_subscription(String, f"{prefix}controller/mode", lambda m: self.modes.append(m.data), LATCHED)
        node.create_subscription(JointState, f"{prefix}effort_command", self.commands.append, 100)

    def spin(self, condition: Any, what: str) -> None:
        from rclpy.executors import SingleThreadedExecutor

        executor = SingleThreadedExecutor(context=self.node.context)
        executor.add_node(self.node)
        try:
            wait_until(lambda: executor.spin_once(0.02) or condition(), what, seen=lambda: f"after {self.modes}")
        finally:
            executor.remove_node(self.node)

    def wait_mode(self, *words: str) -> None:
        count = len(self.modes)
        self.spin(
            lambda: any(all(word in mode for word in words) for mode in self.modes[max(count - 1, 0) :]), f"{words}"
        )

    def decided(self) -> str:
        """Return the present mode where it is not one that passes."""
        mode = self.modes[-1].partition(":")[0] if self.modes else ""
        return mode if mode in ("ACTIVE", "FAULT") else ""

    def wait_law(self) -> None:
        """Wait until the law is at work.

        On a machine too slow for it a fault or a lost object ends it now and then: its user ends the fault, and puts
        the object back.
        """
        for _ in range(ATTEMPTS):
            end = time.monotonic() + PATIENCE_S
            self.spin(lambda end=end: self.decided() or time.monotonic() > end, "the law")
            if self.decided() == "ACTIVE":
                return
            self.trigger("/slip_sim_bridge/reset")
            self.trigger("reset_fault")
            self.trigger("enable")
        self.wait_mode("ACTIVE")

    def call(self, kind: Any, name: str, request: Any) -> Any:
        return call_service(self.node, kind, name, request, self.spin)

    def trigger(self, name: str) -> Any:
        from std_srvs.srv import Trigger

        return self.call(Trigger, name if "/" in name else f"/slip_vic_controller/{name}", Trigger.Request())

    def interfere(self, topic: str, wait_fault: Callable[[], None]) -> None:
        """Publish efforts beside the controller, which is a fault; end it once the publisher is gone."""
        from sensor_msgs.msg import JointState

        foreign = self.node.create_publisher(JointState, topic, 1)
        wait_fault()
        self.node.destroy_publisher(foreign)
        assert not self.trigger("enable").success
        self.spin(lambda: self.node.count_publishers(topic) == 1, "the foreign publisher to go")
        self.spin(lambda: self.trigger("reset_fault").success and "HOLD" in self.modes[-1], "HOLD after the reset")
        assert self.trigger("enable").success

    def change(self, transition: int) -> bool:
        from lifecycle_msgs.msg import Transition
        from lifecycle_msgs.srv import ChangeState

        request = ChangeState.Request(transition=Transition(id=transition))
        return bool(self.call(ChangeState, "/slip_vic_controller/change_state", request).success)


Start = Callable[..., Any]


@pytest.fixture
def watcher(ros_node: Any) -> Watcher:
    return Watcher(ros_node)


@pytest.fixture
def start(processes: Processes, tmp_path: Path) -> Start:
    """Start a node of paper_planar in real time, with assignments."""
    return starter(processes, tmp_path)


@pytest.fixture(scope="module")
def shared_watcher(shared_node: Any) -> Watcher:
    return Watcher(shared_node)


@pytest.fixture(scope="module")
def shared_start(shared_processes: Processes, tmp_path_factory: pytest.TempPathFactory) -> Start:
    """As `start`, for nodes of all tests of a file."""
    return starter(shared_processes, tmp_path_factory.mktemp("nodes"))


def starter(processes: Processes, folder: Path) -> Start:
    """Return what starts nodes; their parameter files lie in `folder`."""

    def run(name: str, *assignments: str, script: Path | None = None) -> Any:
        scenario = load("paper_planar", law="vic", mode="realtime", set=assignments)
        path = folder / f"{name}.yaml"
        path.write_text(ros_parameter_file(getattr(scenario, name), NODES[name][0]))
        node = [script] if script else ["-m", {"controller": CONTROLLER, "bridge": BRIDGE}[name]]
        return processes.python(name, *node, "--ros-args", "--params-file", path)

    return run


# 250 Hz: a busy machine keeps up, and answers that come two ticks late are still in time. 100 Hz bears no delay at all.
CONTROLLER_SLOW = ("controller.control_period_s=0.004", "controller.gains.k_s=50.0")
BRIDGE_ENDLESS = ("bridge.duration_s=1e6", "bridge.control_period_s=0.004")


def test_managed_node_waits_for_transitions(watcher: Watcher, start: Start) -> None:
    follow_transitions(watcher, start, start("controller", "controller.auto_activate=false", *CONTROLLER_SLOW))


def follow_transitions(watcher: Watcher, start: Start, controller: Any) -> None:
    """Lead a controller that waits for transitions through all of them to its end."""
    from lifecycle_msgs.msg import Transition

    assert watcher.change(Transition.TRANSITION_CONFIGURE)
    start("bridge", *BRIDGE_ENDLESS, "bridge.expected_subscribers=0")
    watcher.wait_mode("WAITING_INPUT", "activation")
    watcher.spin(lambda: len(watcher.commands) > 10, "commands")
    assert all(len(command.effort) == 0 for command in watcher.commands)
    assert not watcher.trigger("enable").success
    assert watcher.change(Transition.TRANSITION_ACTIVATE)
    watcher.wait_law()
    watcher.spin(lambda: len(watcher.commands[-1].effort) == 7, "efforts")
    assert watcher.change(Transition.TRANSITION_DEACTIVATE)
    watcher.wait_mode("WAITING_INPUT", "activation")
    assert watcher.change(Transition.TRANSITION_CLEANUP)
    watcher.spin(lambda: watcher.node.count_publishers("/effort_command") == 0, "no publisher")
    assert watcher.change(Transition.TRANSITION_CONFIGURE)
    assert watcher.change(Transition.TRANSITION_ACTIVATE)
    watcher.spin(lambda: len(watcher.commands[-1].effort) == 7, "efforts again")
    assert watcher.change(Transition.TRANSITION_ACTIVE_SHUTDOWN)
    assert controller.has_ended(DEADLINE_S)
    assert controller.poll() == 0, controller.tail()


class System(NamedTuple):
    """Nodes in real time, and who watches them; each test leaves the law at work."""

    watcher: Watcher
    controller: Any
    bridge: Any


@pytest.fixture(scope="module")
def nodes(shared_watcher: Watcher, shared_start: Start) -> System:
    return System(shared_watcher, shared_start("controller", *CONTROLLER_SLOW), shared_start("bridge", *BRIDGE_ENDLESS))


@pytest.mark.smoke
def test_services_move_the_mode(nodes: System) -> None:
    watcher = nodes.watcher
    watcher.wait_law()
    assert watcher.trigger("hold").success
    watcher.wait_mode("hold requested")
    watcher.wait_mode("HOLD")
    assert watcher.trigger("enable").success
    watcher.wait_law()
    assert watcher.trigger("reset_fault").success


def test_watchdog_without_bridge_clock(nodes: System) -> None:
    watcher, bridge = nodes.watcher, nodes.bridge
    watcher.wait_law()
    bridge.send_signal(signal.SIGSTOP)
    watcher.wait_mode("HOLD", "joint state is silent")
    bridge.send_signal(signal.SIGCONT)
    watcher.wait_law()


def test_foreign_publisher_latches_fault(nodes: System) -> None:
    watcher = nodes.watcher
    watcher.wait_law()
    watcher.interfere("effort_command", lambda: watcher.wait_mode("FAULT", "another publisher"))
    watcher.wait_law()


@pytest.mark.smoke
def test_restarted_bridge_is_accepted(nodes: System, shared_start: Start, shared_processes: Processes) -> None:
    watcher = nodes.watcher
    watcher.wait_law()
    shared_processes.kill(nodes.bridge)
    watcher.wait_mode("HOLD", "silent")
    shared_start("bridge", *BRIDGE_ENDLESS, "bridge.expected_subscribers=0")
    watcher.wait_law()
