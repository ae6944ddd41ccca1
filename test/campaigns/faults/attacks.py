"""What somebody who means harm can do to running nodes, each attack a function of the `Stage` it happens on.

None of them lasts longer than some seconds; what comes after is the suite's (`attack_suite`).
"""

from __future__ import annotations

import math
import os
import resource
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import psutil
import rclpy
from geometry_msgs.msg import WrenchStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from slip_vic.run.node_command import node_command
from slip_vic.run.processes import python_module
from test.campaigns.faults.flood import FOREIGN, message
from test.campaigns.faults.plan import BRIDGE, CONTROLLER, Fault

FLOOD_HZ, FLOOD_S = 20_000, 3.0
STOP_S = 5.0
STORM_S = 2.0
ANSWERED_S = 10.0  # until the last of many calls is
CALM_S = 1.0  # after which the nodes take calls of services again
STARTS_S = 6.0  # what a second system needs to start
NODES: Final = {CONTROLLER: "slip_vic_controller", BRIDGE: "slip_sim_bridge"}
LARGEST_SEC = 2**31 - 1
"""A stamp's seconds have 32 bits: the year 2038 is as far as it goes, 2262 is that of 64-bit nanoseconds."""


class Stage(Protocol):
    """Where an attack happens: nodes that run, and a node of ours on the same domain."""

    node: Any
    scenario: Any
    folder: Path

    def go_on(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        """Let time pass, with everything that belongs to the nodes; return whether `until` came true."""

    def pid(self, name: str) -> int:
        """Return the process id of controller or bridge."""

    def start(self, name: str, argv: Sequence[str]) -> Any:
        """Start a process beside the nodes; it ends with the attack."""

    def suffer(self, fault: Fault) -> None:
        """Let a fault of the campaign happen to what travels, beginning now."""

    def load_changes(self) -> None:
        """Say that what the arm carries, or is told to carry, may have changed: it rests a second after that."""


Attack = Callable[[Stage], str]
"""Returns what is worth knowing of how it went; an empty text else."""


@contextmanager
def _publisher(stage: Stage, topic: str, kind: Any) -> Iterator[Any]:
    attacker = Node("attacker", start_parameter_services=False, enable_rosout=False)
    try:
        publisher = attacker.create_publisher(kind, topic, 10)
        stage.go_on(1.0, lambda: publisher.get_subscription_count() > 0)
        yield publisher
    finally:
        attacker.destroy_node()


def _flood(topic: str) -> Attack:
    def flood(stage: Stage) -> str:
        words = python_module("test.campaigns.faults.flood", topic, str(FLOOD_HZ), str(FLOOD_S))
        child = stage.start("flood", words)
        stage.go_on(60.0, lambda: child.exit_code is not None)
        child.wait(1.0)
        return str(child.lines[-1]) if child.lines else ""

    return flood


def giants(stage: Stage) -> str:
    """Arrays of a million numbers, a hundred thousand names, a text of ten million characters."""
    names = [f"j{i}" for i in range(100_000)]
    for topic, kind, made in (
        ("joint_states", JointState, JointState(position=np.zeros(1_000_000))),
        ("joint_states", JointState, JointState(name=names, position=np.zeros(100_000), velocity=np.zeros(100_000))),
        ("wrench", WrenchStamped, WrenchStamped()),
        ("effort_command", JointState, JointState(name=names, effort=np.zeros(100_000))),
    ):
        made.header.frame_id = FOREIGN if topic == "effort_command" else "x" * 10_000_000
        with _publisher(stage, topic, kind) as publisher:
            for _ in range(5):
                publisher.publish(made)
                stage.go_on(0.1)
    return ""


def years(stage: Stage) -> str:
    """Joint states of 1970 and of the last second there is, in turn."""
    made = message("joint_states")
    with _publisher(stage, "joint_states", JointState) as publisher:
        for k in range(200):
            made.header.stamp.sec = (0, LARGEST_SEC, -LARGEST_SEC)[k % 3]
            made.header.stamp.nanosec = (0, 999_999_999)[k % 2]
            publisher.publish(made)
            stage.go_on(0.005)
    return ""


def orders(stage: Stage) -> str:
    """Joint states whose joints stand in another order each time."""
    rng, made = np.random.default_rng(16), message("joint_states")
    with _publisher(stage, "joint_states", JointState) as publisher:
        for _ in range(200):
            made.header.stamp.sec, made.header.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
            made.name = [made.name[i] for i in rng.permutation(7)]
            publisher.publish(made)
            stage.go_on(0.005)
    return ""


def wrong_types(stage: Stage) -> str:
    """Our names with other types: topics, and the services of both nodes."""
    context = rclpy.Context()  # one participant cannot have a topic with two types
    rclpy.init(args=[], context=context, domain_id=rclpy.get_default_context().get_domain_id())
    attacker = Node("attacker", context=context, start_parameter_services=False, enable_rosout=False)
    try:
        topics = ("joint_states", "wrench", "slip_velocity", "effort_command")
        publishers = [attacker.create_publisher(String, name, 10) for name in topics]
        attacker.create_service(SetParameters, "/slip_vic_controller/hold", lambda _, response: response)
        attacker.create_service(Trigger, "/slip_sim_bridge/set_parameters", lambda _, response: response)
        for _ in range(100):
            for publisher in publishers:
                publisher.publish(String(data="x"))
            stage.go_on(0.01)
    finally:
        attacker.destroy_node()
        rclpy.try_shutdown(context=context)
    return ""


def parameters(stage: Stage) -> str:
    """Every parameter of both nodes with anything, as fast as calls can be made."""
    rng, calls, newest = np.random.default_rng(16), 0, dict[Any, Any]()
    values: tuple[Any, ...] = (math.nan, 1e300, 5e-324, -1.0, 0.0, 1, True, "x" * 1000, [1.0] * 6, ["a"] * 100, [])
    names = ("gains.stiffness", "gains.k_s", "object.mass", "grip.force", "mode", "", "no.such", "use_sim_time")
    clients = [stage.node.create_client(SetParameters, f"/{name}/set_parameters") for name in NODES.values()]
    end = time.monotonic() + STORM_S
    while time.monotonic() < end:
        for client in clients:
            request = SetParameters.Request()
            for name in names:
                value = values[int(rng.integers(len(values)))]
                request.parameters.append(Parameter(name, value=value if value != [] else None).to_parameter_msg())
            newest[client] = client.call_async(request)
            calls += 1
        stage.load_changes()
        stage.go_on(0.002)
    stage.go_on(ANSWERED_S, lambda: all(future.done() for future in newest.values()))
    stage.load_changes()  # a busy machine sets the last of them later
    for client in clients:
        stage.node.destroy_client(client)
    return f"{calls} calls"


def lifecycle(stage: Stage) -> str:
    """Any transition at any time, but for those that ask the node to end; at last it is configured and activated."""
    rng = np.random.default_rng(16)
    client = stage.node.create_client(ChangeState, "/slip_vic_controller/change_state")
    stage.go_on(5.0, client.service_is_ready)

    def change(number: int, patience_s: float) -> None:
        future = client.call_async(ChangeState.Request(transition=Transition(id=number)))
        stage.go_on(patience_s, future.done)

    for _ in range(60):
        change(int(rng.choice((0, 1, 2, 3, 4, 8, 10, 30, 97, 98, 99, 255))), 1.0)
    stage.go_on(CALM_S)
    for number in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
        change(number, 5.0)
    stage.node.destroy_client(client)
    return ""


def storm(stage: Stage) -> str:
    """Any transition, also those that end the node, and parameters of it, at once and as fast as calls can be made."""
    rng, calls, futures = np.random.default_rng(28), 0, []
    change = stage.node.create_client(ChangeState, "/slip_vic_controller/change_state")
    set_ = stage.node.create_client(SetParameters, "/slip_vic_controller/set_parameters")
    stage.go_on(5.0, lambda: change.service_is_ready() and set_.service_is_ready())
    end = time.monotonic() + STORM_S
    while time.monotonic() < end:
        # What comes alone is an operator's wish: the first ones do not end the node.
        number = int(rng.integers(256)) if calls > 40 else int(rng.integers(5))
        gain = Parameter("gains.k_s", value=float(rng.uniform(1.0, 9.0))).to_parameter_msg()
        futures.append(change.call_async(ChangeState.Request(transition=Transition(id=number))))
        futures.append(set_.call_async(SetParameters.Request(parameters=[gain])))
        calls += 2
        stage.go_on(0.002)
    stage.go_on(CALM_S)
    for number in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
        done = change.call_async(ChangeState.Request(transition=Transition(id=number)))
        stage.go_on(5.0, done.done)
    for client in (change, set_):
        stage.node.destroy_client(client)
    return f"{calls} calls, {sum(future.done() for future in futures)} answered"


def giant_requests(stage: Stage) -> str:
    """Services called with some megabytes: many parameters, many names, a long text."""
    many = [Parameter("gains.k_s", value=5.0).to_parameter_msg()] * 20_000
    text = [Parameter("mode", value="x" * 5_000_000).to_parameter_msg()]
    slowest = 0.0
    for node in NODES.values():
        for kind, name, request in (
            (SetParameters, "set_parameters", SetParameters.Request(parameters=many)),
            (SetParameters, "set_parameters", SetParameters.Request(parameters=text)),
            (GetParameters, "get_parameters", GetParameters.Request(names=["gains.k_s"] * 100_000)),
        ):
            client = stage.node.create_client(kind, f"/{node}/{name}")
            stage.go_on(5.0, client.service_is_ready)
            future, began = client.call_async(request), time.monotonic()
            stage.go_on(20.0, future.done)
            slowest = max(slowest, time.monotonic() - began)
            stage.node.destroy_client(client)
    return f"answered within {slowest:.2f} s"


def _stopped(name: str) -> Attack:
    def stop(stage: Stage) -> str:
        os.kill(stage.pid(name), signal.SIGSTOP)
        try:
            stage.go_on(STOP_S)
        finally:
            os.kill(stage.pid(name), signal.SIGCONT)
        return ""

    return stop


def memory(stage: Stage) -> str:
    """The controller may take no more memory than it has, while messages of a million numbers arrive."""
    pid, size = stage.pid(CONTROLLER), psutil.Process(stage.pid(CONTROLLER)).memory_info().vms
    before = resource.prlimit(pid, resource.RLIMIT_AS)
    resource.prlimit(pid, resource.RLIMIT_AS, (size + (1 << 20), before[1]))
    try:
        with _publisher(stage, "joint_states", JointState) as publisher:
            for _ in range(5):
                publisher.publish(JointState(position=np.zeros(1_000_000)))
                stage.go_on(0.3)
    finally:
        resource.prlimit(pid, resource.RLIMIT_AS, before)
    return ""


def another_system(stage: Stage) -> str:
    """A second bridge and controller in a namespace of their own, on the same domain."""
    started = []
    for name in (CONTROLLER, BRIDGE):
        folder = stage.folder / f"other_{name}"
        folder.mkdir(exist_ok=True)
        argv = node_command(name, getattr(stage.scenario, name), folder, "-r", "__ns:=/other")
        started.append(stage.start(f"other {name}", argv))
    stage.go_on(STARTS_S)
    return "" if all(child.exit_code is None for child in started) else "the other system ended"


def clock_back(stage: Stage) -> str:
    """The bridge's clock is set back by ten seconds; and /clock says what it wants."""
    stage.suffer(Fault("clock_jump", BRIDGE, 0.0, 1.0, size=0.125))
    with _publisher(stage, "/clock", Clock) as publisher:
        for k in range(100):
            made = Clock()
            made.clock.sec = LARGEST_SEC if k % 2 else 0
            publisher.publish(made)
            stage.go_on(0.01)
    return ""


def second_controller(stage: Stage) -> str:
    """Another controller under the same name, on the same topics."""
    folder = stage.folder / "second"
    folder.mkdir(exist_ok=True)
    stage.start("second controller", node_command(CONTROLLER, stage.scenario.controller, folder))
    stage.go_on(STARTS_S)
    return ""


def foreign_efforts(stage: Stage) -> str:
    """Efforts of another publisher, each at another end of what a joint bears, and some that are no numbers."""
    rng, made = np.random.default_rng(16), message("effort_command")
    with _publisher(stage, "effort_command", JointState) as publisher:
        for k in range(200):
            made.header.stamp.sec, made.header.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
            made.effort = (rng.choice((-1e3, 1e3), 7) if k % 10 else np.full(7, math.nan)).tolist()
            publisher.publish(made)
            stage.go_on(0.005)
    return ""


ATTACKS: Final[dict[str, Attack]] = {
    "20 kHz of joint states": _flood("joint_states"),
    "20 kHz of wrenches": _flood("wrench"),
    "20 kHz of effort commands": _flood("effort_command"),
    "giant arrays and texts": giants,
    "stamps of 1970 and 2038": years,
    "joint orders that alternate": orders,
    "our names with wrong types": wrong_types,
    "parameter storm": parameters,
    "random lifecycle": lifecycle,
    "transitions and parameters at once": storm,
    "giant requests": giant_requests,
    "SIGSTOP of the controller, 5 s": _stopped(CONTROLLER),
    "SIGSTOP of the bridge, 5 s": _stopped(BRIDGE),
    "memory limit of the controller": memory,
    "domain shared with another system": another_system,
    "clock set back": clock_back,
    "second controller": second_controller,
    "foreign efforts": foreign_efforts,
}
"""By the name in the table."""
CHANGES: Final = ("parameter storm", "transitions and parameters at once")
"""What leaves nodes behind that are not as they were: grip and gains."""
TWO_SOURCES: Final = ("second controller",)
"""Where commands of ours alternate with each other's: only each by itself can be judged."""
