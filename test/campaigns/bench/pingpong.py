"""Ping-pong over DDS with the messages of a lockstep tick, and nothing computed: the unit of all DDS figures.

One side sends wrench, slip, joint state and tick list, which the partner waits for, and clock, object and slip truth,
which it does not; the other answers with effort and ledger. R0: two processes with default nodes, the default executor
and typed messages.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import rclpy
from geometry_msgs.msg import TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Int64MultiArray

from slip_core.stamps import stamp_to_ns
from slip_msgs_py.environment import choose_transport
from slip_msgs_py.messages import forms

NAMES = tuple(f"arm_joint{i}" for i in range(1, 8))
JOINTS = forms.joint_state(NAMES)
NEEDED = {
    "pp_wrench": (WrenchStamped, forms.wrench("ee")),
    "pp_slip": (TwistStamped, forms.twist("ee")),
    "pp_joints": (JointState, JOINTS),
    "pp_tick": (Int64MultiArray, forms.whole_numbers(5)),
}
TRUTH = {
    "pp_clock": (Clock, forms.clock()),
    "pp_object": (Odometry, forms.odometry()),
    "pp_truth": (JointState, forms.slip_truth()),
}
EFFORT, LEDGER = "pp_effort", "pp_ledger"
WARM_UP = 100
START_TIMEOUT_S = 20.0
REPEAT_S = 0.2  # best effort may lose a message: ask again


QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)


def sender(node: Node, name: str, kind: Any, form: forms.Form) -> Callable[[int], None]:
    """Return a function that publishes this form with a tick as its stamp or first number."""
    publisher, numbers = node.create_publisher(kind, name, QOS), [[0] * size for size in form.sizes]
    if form.stamp:
        return lambda tick: publisher.publish(form.message(tick, *numbers))
    return lambda tick: publisher.publish(form.message(0, [tick, *numbers[0][1:]]))


def subscribe(node: Node, name: str, kind: Any, form: forms.Form, deliver: Callable[[int], None]) -> Any:
    """Subscribe; `deliver` gets the tick that the message carries as its stamp [ns] or first number."""

    def take(message: Any) -> None:
        deliver(stamp_to_ns(message.header.stamp) if form.stamp else message.data[0])

    return node.create_subscription(kind, name, take, QOS)


def answer(node: Node, executor: SingleThreadedExecutor) -> None:
    """Answer every complete set of states with effort and ledger, until the process is ended."""
    send_effort = sender(node, EFFORT, JointState, JOINTS)
    send_ledger = sender(node, LEDGER, Int64MultiArray, forms.whole_numbers(12))
    seen = dict.fromkeys(NEEDED, -1)

    def deliver(name: str, tick: int) -> None:
        seen[name] = tick
        if len(set(seen.values())) == 1:
            send_effort(tick)
            send_ledger(tick)

    for name, (kind, form) in NEEDED.items():
        subscribe(node, name, kind, form, partial(deliver, name))
    while rclpy.ok():
        executor.spin_once(timeout_sec=1.0)


def ask(node: Node, executor: SingleThreadedExecutor, rounds: int) -> list[float]:
    """Send a set, wait for its effort, and so on; return the round trips after the warm-up [s]."""
    sends = [sender(node, name, kind, form) for name, (kind, form) in {**NEEDED, **TRUTH}.items()]
    answered = [-1]
    subscription = subscribe(node, EFFORT, JointState, JOINTS, answered.append)
    deadline = time.monotonic() + START_TIMEOUT_S
    while not subscription.get_publisher_count() or not all(node.count_subscribers(name) for name in NEEDED):
        if time.monotonic() > deadline:
            raise TimeoutError("no partner")
        executor.spin_once(timeout_sec=0.05)
    times = []
    for tick in range(WARM_UP + rounds):
        start = time.perf_counter()
        repeat = 0.0
        while answered[-1] != tick:
            if time.perf_counter() >= repeat:
                repeat = time.perf_counter() + REPEAT_S
                for send in sends:
                    send(tick)
            executor.spin_once(timeout_sec=REPEAT_S)
        times.append(time.perf_counter() - start)
    return times[WARM_UP:]


def main(side: str, rounds: int) -> int:
    """Run one side, `ask` or `answer`."""
    choose_transport()
    rclpy.init(args=[])
    node, executor = Node(f"pp_{side}"), SingleThreadedExecutor()
    executor.add_node(node)
    try:
        if side == "ask":
            print(json.dumps(ask(node, executor, rounds)))
        else:
            answer(node, executor)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass  # the usual end of the side that answers
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2])))
