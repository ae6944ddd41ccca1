"""What an attacker on the same network can do to running nodes: each attack is a function of the `Stage`.

An attack lasts some seconds; the suite observes what follows.
"""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import rclpy
from geometry_msgs.msg import WrenchStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from slip_vic.run.processes import python_module
from test.campaigns.attacks.flood import FOREIGN, message
from test.campaigns.faults.plan import BRIDGE, CONTROLLER, JOINT, SLIP, WRENCH
from test.campaigns.faults.wire import Wire

if TYPE_CHECKING:
    from test.campaigns.attacks.suite import Stage

FLOOD_HZ, FLOOD_S = 20_000, 3.0
STOP_S = 5.0
STORM_S = 2.0
CALM_S = 1.0  # after which the nodes take calls of services again
STARTS_S = 6.0  # what a second system needs to start
NODES: Final = {CONTROLLER: "slip_vic_controller", BRIDGE: "slip_sim_bridge"}
LARGEST_SEC = 2**31 - 1
"""A stamp has 32 bits for seconds, so it ends in 2038."""

Attack = Callable[["Stage"], str]
"""Returns a note on what happened, or an empty text."""


@contextmanager
def _publisher(stage: Stage, topic: str, kind: Any) -> Iterator[Any]:
    attacker = Node("attacker", start_parameter_services=False, enable_rosout=False)
    try:
        publisher = attacker.create_publisher(kind, topic, 10)
        stage.wait(1.0, lambda: publisher.get_subscription_count() > 0)
        yield publisher
    finally:
        attacker.destroy_node()


def _flood(topic: str) -> Attack:
    def flood(stage: Stage) -> str:
        words = python_module("test.campaigns.attacks.flood", topic, str(FLOOD_HZ), str(FLOOD_S))
        child = stage.start("flood", words)
        stage.wait(60.0, lambda: child.poll() is not None)
        child.has_ended(1.0)
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
                stage.wait(0.1)
    return ""


def broken(stage: Stage) -> str:
    """Messages with bad numbers, wrong names, bits that are flipped and ends that are cut or lengthened."""
    rng, params = np.random.default_rng(1), stage.scenario.controller
    for topic in (JOINT, WRENCH, SLIP):
        wire, made = Wire(topic, params.joint_names, params.ee_frame), message(topic)
        kinds = ("corrupt_bytes", "corrupt_values", *["wrong_names"] * (topic == JOINT))
        with _publisher(stage, topic, type(made)) as publisher:
            for k in range(150):
                publisher.publish(wire.damaged(message(topic), kinds[k % len(kinds)], rng))
                stage.wait(0.005)
    return ""


def years(stage: Stage) -> str:
    """Joint states of 1970 and of the last second there is, in turn."""
    made = message("joint_states")
    with _publisher(stage, "joint_states", JointState) as publisher:
        for k in range(200):
            made.header.stamp.sec = (0, LARGEST_SEC, -LARGEST_SEC)[k % 3]
            made.header.stamp.nanosec = (0, 999_999_999)[k % 2]
            publisher.publish(made)
            stage.wait(0.005)
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
            stage.wait(0.01)
    finally:
        attacker.destroy_node()
        rclpy.try_shutdown(context=context)
    return ""


VALUES: Final[tuple[Any, ...]] = (math.nan, 1e300, 5e-324, -1.0, 1, True, "x" * 1000, [1.0] * 6, ["a"] * 100)
TRIGGERS: Final = ("enable", "hold", "reset_fault", "tare")
NAMES: Final = ("gains.stiffness", "gains.k_s", "object.mass", "grip.force", "mode", "", "no.such", "use_sim_time")


def storm(stage: Stage) -> str:
    """Any transition and request of the controller, any parameter of both nodes, as fast as calls can be made."""
    rng, futures = np.random.default_rng(28), []
    change = stage.node.create_client(ChangeState, f"/{NODES[CONTROLLER]}/change_state")
    setters = [stage.node.create_client(SetParameters, f"/{node}/set_parameters") for node in NODES.values()]
    triggers = [stage.node.create_client(Trigger, f"/{NODES[CONTROLLER]}/{name}") for name in TRIGGERS]
    clients = (change, *setters, *triggers)
    stage.wait(5.0, lambda: all(client.service_is_ready() for client in clients))
    end = time.monotonic() + STORM_S
    while time.monotonic() < end:
        # A shutdown, 5 to 7, is an operator's wish and ends the node.
        number = int(rng.choice(np.delete(np.arange(256), (5, 6, 7)))) if len(futures) > 40 else int(rng.integers(5))
        futures.append(change.call_async(ChangeState.Request(transition=Transition(id=number))))
        values = [Parameter(name, value=VALUES[int(rng.integers(len(VALUES)))]).to_parameter_msg() for name in NAMES]
        futures += [client.call_async(SetParameters.Request(parameters=values)) for client in setters]
        futures += [client.call_async(Trigger.Request()) for client in rng.permutation(np.array(triggers))[:2]]
        stage.wait(0.002)
    stage.wait(CALM_S)
    back = (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)
    for number in back:
        stage.wait(5.0, change.call_async(ChangeState.Request(transition=Transition(id=number))).done)
    for client in clients:
        stage.node.destroy_client(client)
    return f"{len(futures)} calls, {sum(future.done() for future in futures)} answered"


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
            stage.wait(5.0, client.service_is_ready)
            future, began = client.call_async(request), time.monotonic()
            stage.wait(20.0, future.done)
            slowest = max(slowest, time.monotonic() - began)
            stage.node.destroy_client(client)
    return f"answered within {slowest:.2f} s"


def stop_controller(stage: Stage) -> str:
    """The controller is stopped for five seconds (SIGSTOP)."""
    os.kill(stage.pid(CONTROLLER), signal.SIGSTOP)
    try:
        stage.wait(STOP_S)
    finally:
        os.kill(stage.pid(CONTROLLER), signal.SIGCONT)
    return ""


def second_controller(stage: Stage) -> str:
    """Another controller under the same name, on the same topics."""
    stage.start_controller("second")
    stage.wait(STARTS_S)
    return ""


def foreign_efforts(stage: Stage) -> str:
    """Efforts of another publisher, each at another end of what a joint bears, and some that are no numbers."""
    rng, made = np.random.default_rng(16), message("effort_command")
    with _publisher(stage, "effort_command", JointState) as publisher:
        for k in range(200):
            made.header.stamp.sec, made.header.stamp.nanosec = divmod(time.time_ns(), 1_000_000_000)
            made.effort = (rng.choice((-1e3, 1e3), 7) if k % 10 else np.full(7, math.nan)).tolist()
            publisher.publish(made)
            stage.wait(0.005)
    return ""


ATTACKS: Final[dict[str, Attack]] = {
    "20 kHz of joint states": _flood("joint_states"),
    "20 kHz of effort commands": _flood("effort_command"),
    "giant arrays and texts": giants,
    "messages that are none": broken,
    "stamps of 1970 and 2038": years,
    "our names with wrong types": wrong_types,
    "transitions and parameters at once": storm,
    "giant requests": giant_requests,
    "SIGSTOP of the controller, 5 s": stop_controller,
    "second controller": second_controller,
    "foreign efforts": foreign_efforts,
}
"""By the name in the table."""
TWO_SOURCES: Final = ("second controller",)
"""Where commands of ours alternate with each other's: only each by itself can be judged."""
