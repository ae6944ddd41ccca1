"""Ping-pong over DDS with the messages of a lockstep tick, and nothing computed: the unit of all DDS figures.

There go wrench, slip, joint state and tick list, which the partner waits for, and clock, object and slip truth, which
it does not; back come effort and ledger. ``default`` is R0, what everybody writes first: default nodes, the default
executor, typed messages. ``raw`` is this suite's own path: EventsExecutor, bytes both ways. Two processes.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import rclpy
from geometry_msgs.msg import TwistStamped, WrenchStamped
from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Int64MultiArray

from slip_core.stamps import stamp_to_ns
from slip_msgs_py.environment import choose_transport
from slip_msgs_py.executor import Spinner
from slip_msgs_py.messages import forms
from slip_msgs_py.messages.cdr import CdrCodec

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
LEDGER_FORM = forms.whole_numbers(12)
START_TIMEOUT_S = 20.0
REPEAT_S = 0.2  # best effort may lose a message: ask again


def codec(form: forms.Form) -> CdrCodec:
    """Return the codec of a form in its usual sizes."""
    return CdrCodec(form.make(0, *form.zeros()), form.fields, form.stamp)


class Side:
    """One side: a node, its executor, and how messages are made and read.

    Args:
        name: of the node.
        fast: this suite's path instead of the default one.
    """

    def __init__(self, name: str, *, fast: bool) -> None:
        self.node = Node(name)
        self.executor = EventsExecutor() if fast else SingleThreadedExecutor()
        self._spinner = Spinner(self.executor)
        self.fast = fast
        self._qos = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)

    def wait(self, timeout_s: float) -> None:
        """Run callbacks: at most for this time; the fast path until `enough`, the default one a callback at a time."""
        if self.fast:
            self._spinner.spin(timeout_s)
        else:
            self.executor.spin_once(timeout_sec=timeout_s)

    def enough(self) -> None:
        """End the present `wait` after this callback."""
        self._spinner.enough()

    def publisher(self, name: str, kind: Any, form: forms.Form) -> Any:
        """Return (stamp_ns, *numbers) -> None that publishes."""
        publisher = self.node.create_publisher(kind, name, self._qos)
        if self.fast:
            encode = codec(form).encode
            return lambda stamp_ns, *numbers: publisher.publish(encode(stamp_ns, *numbers))
        return lambda stamp_ns, *numbers: publisher.publish(form.make(stamp_ns, *numbers))

    def sender(self, name: str, kind: Any, form: forms.Form) -> Callable[[int], None]:
        """Return what publishes this form with the stamp or tick it is given."""
        publish = self.publisher(name, kind, form)
        numbers = form.zeros()
        if form.stamp:
            return lambda tick: publish(tick, *numbers)
        return lambda tick: publish(tick, [tick, *numbers[0][1:].tolist()])

    def subscribe(self, name: str, kind: Any, form: forms.Form, deliver: Callable[[int], None]) -> Any:
        """Subscribe; `deliver` gets the tick that the message carries as its stamp [ns] or first number."""
        if not self.fast:

            def take_typed(message: Any) -> None:
                deliver(stamp_to_ns(message.header.stamp) if form.stamp else message.data[0])

            return self.node.create_subscription(kind, name, take_typed, self._qos)
        decode = codec(form).decode

        def take_raw(data: bytes) -> None:
            read = decode(data)
            if read is not None:
                deliver(read[0] if form.stamp else int(read[1][0][0]))

        return self.node.create_subscription(kind, name, take_raw, self._qos, raw=True)


def answer(side: Side) -> None:
    """Answer every complete set of states with effort and ledger, until the process is ended."""
    send_effort = side.sender(EFFORT, JointState, JOINTS)
    send_ledger = side.sender(LEDGER, Int64MultiArray, LEDGER_FORM)
    seen = dict.fromkeys(NEEDED, -1)

    def deliver(name: str, tick: int) -> None:
        seen[name] = tick
        if len(set(seen.values())) == 1:
            send_effort(tick)
            send_ledger(tick)

    for name, (kind, form) in NEEDED.items():
        side.subscribe(name, kind, form, partial(deliver, name))
    side.executor.add_node(side.node)
    while rclpy.ok():
        side.wait(1.0)


def ask(side: Side, rounds: int, warm_up: int) -> list[float]:
    """Send a set, wait for its effort, and so on; return the round trips after the warm-up [s]."""
    sends = [side.sender(name, kind, form) for name, (kind, form) in {**NEEDED, **TRUTH}.items()]
    answered = -1

    def deliver(tick: int) -> None:
        nonlocal answered
        answered = tick
        side.enough()

    subscription = side.subscribe(EFFORT, JointState, JOINTS, deliver)
    side.executor.add_node(side.node)
    deadline = time.monotonic() + START_TIMEOUT_S
    while not subscription.get_publisher_count() or not all(side.node.count_subscribers(name) for name in NEEDED):
        if time.monotonic() > deadline:
            raise TimeoutError("no partner")
        side.wait(0.05)
    times = []
    for tick in range(rounds + warm_up):
        start = time.perf_counter()
        repeat = 0.0
        while answered != tick:
            if time.perf_counter() >= repeat:
                repeat = time.perf_counter() + REPEAT_S
                for send in sends:
                    send(tick)
            side.wait(REPEAT_S)
        times.append(time.perf_counter() - start)
    return times[warm_up:]


def main(argv: Sequence[str] | None = None) -> int:
    """Run one side."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("side", choices=["ask", "answer"])
    parser.add_argument("--path", choices=["default", "raw"], default="default")
    parser.add_argument("--rounds", type=int, default=1000)
    parser.add_argument("--warm-up", type=int, default=100)
    words = parser.parse_args(argv)
    choose_transport()
    rclpy.init(args=[])
    try:
        side = Side(f"pp_{words.side}", fast=words.path == "raw")
        if words.side == "ask":
            print(json.dumps(ask(side, words.rounds, words.warm_up)))
        else:
            answer(side)
    except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        pass  # the usual end of the side that answers
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
