"""What arrives from outside, on topics, services, parameters and transitions, does not end the nodes.

Unexpected exceptions are loud in tests: a node that goes on here has met none, but for the last test's own bug.
"""

# ruff: noqa: F811 - fixtures are found by name

from __future__ import annotations

import math
import random
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from slip_msgs_py.node_shell import LOUD_VARIABLE
from test.support.ros import Processes
from test.system.nodes.test_modes import (  # noqa: F401
    BRIDGE_ENDLESS,
    CONTROLLER_SLOW,
    System,
    Watcher,
    nodes,
    shared_start,
    shared_watcher,
    start,
    watcher,
)  # fmt: skip

NODES = ("slip_vic_controller", "slip_sim_bridge")
JOINTS = [f"arm_joint{i}" for i in range(1, 8)]
STAMPS = (
    (2**31 - 1, 999_999_999),
    (2**31 - 1, 2**32 - 1),
    (0, 2**32 - 1),
    (-(2**31), 0),
    (-(2**31), 2**32 - 1),
    (0, 0),
)
NUMBERS = (math.nan, math.inf, 1e300, -1e300, 5e-324, 0.0)
FOREIGN = "foreign"
PROMPT_S = 0.3  # from the first foreign command to FAULT; discovery and a crowded machine included


class Attacker:
    """Sends what no friend would, and sees that the nodes go on."""

    def __init__(self, watcher: Watcher, nodes: list[Any]) -> None:
        self.watcher, self.nodes = watcher, nodes

    def pause(self, seconds: float = 0.1) -> None:
        end = time.monotonic() + seconds
        self.watcher.spin(lambda: time.monotonic() > end, "a pause")

    def publish(self, topic: str, messages: list[Any]) -> None:
        """Publish messages of one type, each a few times."""
        publisher = self.watcher.node.create_publisher(type(messages[0]), topic, 10)
        if topic == "effort_command":
            for message in messages:
                message.header.frame_id = FOREIGN
        self.watcher.spin(lambda: publisher.get_subscription_count() > 0, f"somebody who listens to {topic}")
        for message in messages:
            for _ in range(3):
                publisher.publish(message)
                time.sleep(0.001)
        self.pause(0.03)
        self.watcher.node.destroy_publisher(publisher)

    def publish_anyway(self, topic: str, messages: list[Any]) -> None:
        """Publish where perhaps nobody listens, and should not."""
        publisher = self.watcher.node.create_publisher(type(messages[0]), topic, 10)
        self.pause()
        for message in messages:
            publisher.publish(message)
        self.pause()
        self.watcher.node.destroy_publisher(publisher)

    def set(self, node: str, **values: Any) -> list[bool]:
        """Set parameters, "__" standing for a dot; return which were accepted."""
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter

        given = [Parameter(name.replace("__", "."), value=value).to_parameter_msg() for name, value in values.items()]
        results = self.watcher.call(SetParameters, f"/{node}/set_parameters", SetParameters.Request(parameters=given))
        return [result.successful for result in results.results]

    def nodes_go_on(self, after: str) -> None:
        for node in self.nodes:
            assert node.exit_code is None, f"{node.name} ended with {node.exit_code} after {after}:\n{node.tail()}"
        ours = [message.effort for message in self.watcher.commands if message.header.frame_id != FOREIGN]
        assert all(math.isfinite(x) for effort in ours for x in effort), after


def stamped(kind: Any, sec: int, nanosec: int, **fields: Any) -> Any:
    message = kind(**fields)
    message.header.stamp.sec, message.header.stamp.nanosec = sec, nanosec
    return message


def hostile_stamps(attacker: Attacker) -> None:
    from geometry_msgs.msg import TwistStamped, WrenchStamped
    from sensor_msgs.msg import JointState

    numbers = {"position": [0.1] * 7, "velocity": [0.0] * 7, "effort": [0.0] * 7}
    for topic in ("joint_states", "effort_command"):
        attacker.publish(topic, [stamped(JointState, *stamp, name=JOINTS, **numbers) for stamp in STAMPS])
    attacker.publish("wrench", [stamped(WrenchStamped, *stamp) for stamp in STAMPS])
    attacker.publish("slip_velocity", [stamped(TwistStamped, *stamp) for stamp in STAMPS])


def hostile_numbers(attacker: Attacker) -> None:
    from geometry_msgs.msg import TwistStamped, Vector3, WrenchStamped
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64

    now = (int(time.time()), 0)
    for topic in ("joint_states", "effort_command"):
        arrays = [{"position": [x] * 7, "velocity": [x] * 7, "effort": [x] * 7} for x in NUMBERS]
        messages = [stamped(JointState, *now, name=JOINTS, **numbers) for numbers in arrays]
        messages += [JointState(), JointState(name=JOINTS), JointState(name=["x" * 100_000], effort=[0.0] * 100_000)]
        attacker.publish(topic, [*messages, JointState(name=JOINTS * 2), JointState(name=JOINTS, position=[0.0] * 7)])
    wrenches, twists = [], []
    for x in NUMBERS:
        vector = Vector3(x=x, y=x, z=x)
        wrenches.append(stamped(WrenchStamped, *now))
        wrenches[-1].wrench.force = wrenches[-1].wrench.torque = vector
        twists.append(stamped(TwistStamped, *now))
        twists[-1].twist.linear = twists[-1].twist.angular = vector
    wrenches[0].header.frame_id = "hand of god" * 1000
    attacker.publish("wrench", wrenches)
    attacker.publish("slip_velocity", twists)
    attacker.publish("grip_force", [Float64(data=x) for x in (*NUMBERS, -1.0, 0.5)])


def clocks(attacker: Attacker) -> None:
    from rosgraph_msgs.msg import Clock

    assert attacker.set("slip_vic_controller", use_sim_time=True) == [False]
    assert attacker.set("slip_sim_bridge", use_sim_time=True) == [False]
    messages = [Clock() for _ in STAMPS]
    for message, (sec, nanosec) in zip(messages, (*STAMPS[:5], (1, 0)), strict=True):
        message.clock.sec, message.clock.nanosec = sec, nanosec
    attacker.publish_anyway("/clock", messages)


def parameters(attacker: Attacker) -> None:
    node = "slip_vic_controller"
    for x in (1e-300, 5e-324, 1e300, 0.0, -1.0, math.nan, math.inf):
        six = [x] * 6
        assert not any(attacker.set(node, gains__stiffness=six, gains__damping=six, gains__inertia=six)), x
        assert not any(attacker.set(node, object__mass=x, gains__alpha=x, gains__k_s=x, gains__ramp_s=x)), x
        attacker.set(node, nullspace__stiffness=x, nullspace__damping=x, gains__gamma_kp=x, singularity__sigma_min=x)
    attacker.pause(1.0)  # more at once are refused
    attacker.set(node, nullspace__stiffness=10.0, nullspace__damping=2.0, gains__gamma_kp=100.0)
    attacker.set(node, singularity__sigma_min=0.04)
    wrong = {"gains__k_s": "fast", "gains__stiffness": [1.0], "joint_names": ["a"], "no__such": 1, "mode": 3}
    assert not any(attacker.set(node, **wrong))
    assert not any(attacker.set(node, **{"": 1.0, "a b": 1.0, "x" * 10_000: 1.0}))
    for x in (1e-300, 1e300, -1.0, math.nan):
        attacker.set("slip_sim_bridge", grip__force=x, sensors__slip__noise_linear=x)
    attacker.set("slip_sim_bridge", grip__force=0.5)


def services(attacker: Attacker) -> None:
    """What rclpy answers by itself."""
    from rcl_interfaces.srv import DescribeParameters, GetParameters, GetParameterTypes, ListParameters

    names = ["", "gains.k_s", "no such", "x" * 10_000]
    for node in NODES:
        call: Callable[..., Any] = attacker.watcher.call
        for name in names:
            call(GetParameters, f"/{node}/get_parameters", GetParameters.Request(names=[name]))
            call(DescribeParameters, f"/{node}/describe_parameters", DescribeParameters.Request(names=[name]))
            call(GetParameterTypes, f"/{node}/get_parameter_types", GetParameterTypes.Request(names=[name]))
        request = ListParameters.Request(prefixes=names, depth=2**63)
        call(ListParameters, f"/{node}/list_parameters", request)


def transitions(attacker: Attacker) -> None:
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState

    watcher, rng = attacker.watcher, random.Random(16)
    wanted = (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)
    assert not watcher.change(Transition.TRANSITION_ACTIVATE)  # it is active
    assert not watcher.change(Transition.TRANSITION_CONFIGURE)
    for name in ("activate", "no such", "transition_success", "x" * 1000):
        request = ChangeState.Request(transition=Transition(label=name))
        assert not watcher.call(ChangeState, "/slip_vic_controller/change_state", request).success
    for _ in range(40):
        watcher.change(rng.choice((0, 1, 2, 3, 4, 8, 10, 30, 97, 98, 99, 255)))  # all but those that shut down
    attacker.pause(1.0)  # more at once are refused
    for transition in wanted:
        watcher.change(transition)


ATTACKS = (hostile_stamps, hostile_numbers, clocks, parameters, services, transitions)


@pytest.mark.parametrize("loud", ["0", "1"])
def test_a_bug_of_our_own_is_a_fault_with_efforts_that_go_on(
    watcher: Watcher,
    start: Any,
    processes: Processes,
    loud: str,
) -> None:
    processes.environment[LOUD_VARIABLE] = loud
    controller = start("controller", *CONTROLLER_SLOW, script=Path(__file__).with_name("failing_controller.py"))
    start("bridge", *BRIDGE_ENDLESS)
    if loud == "1":
        assert processes.wait_end(controller) == 1
        assert "ZeroDivisionError: put in by a test" in controller.tail()
        return
    watcher.wait_mode("FAULT", "internal error", "~/reset_fault")
    count = len(watcher.commands)
    watcher.spin(lambda: len(watcher.commands) > count + 50, "efforts that go on")
    assert all(len(message.effort) == 7 for message in watcher.commands[count:])
    assert sum("failed in" in line for line in controller.lines) == 1, controller.tail()
    watcher.wait_law()


@pytest.mark.parametrize("loud", ["0", "1"])
def test_a_bug_of_the_bridge_puts_the_arm_back_and_does_not_end_it(
    watcher: Watcher, start: Any, processes: Processes, loud: str
) -> None:
    from rcl_interfaces.srv import SetParameters
    from sensor_msgs.msg import JointState

    positions: list[float] = []
    watcher.node.create_subscription(JointState, "joint_states", lambda m: positions.append(m.position[0]), 100)
    processes.environment[LOUD_VARIABLE] = loud
    start("controller", *CONTROLLER_SLOW)
    bridge = start("bridge", *BRIDGE_ENDLESS, script=Path(__file__).with_name("failing_bridge.py"))
    if loud == "1":
        assert processes.wait_end(bridge) == 1
        assert "ZeroDivisionError: put in by a test" in bridge.tail()
        return
    watcher.spin(lambda: any("failed in a tick" in line for line in bridge.lines), "the failure")
    count = len(positions)
    watcher.spin(lambda: len(positions) > count + 100, "joint states that go on")
    assert sum("failed in" in line for line in bridge.lines) == 1, bridge.tail()
    assert watcher.call(SetParameters, "/slip_sim_bridge/set_parameters", SetParameters.Request()) is not None
    watcher.wait_law()


def test_a_run_with_a_failure_in_it_does_not_end_well(start: Any, processes: Processes) -> None:
    processes.environment[LOUD_VARIABLE] = "0"
    script = Path(__file__).with_name("failing_bridge.py")
    start("controller", *CONTROLLER_SLOW)
    bridge = start("bridge", "bridge.control_period_s=0.004", "bridge.duration_s=2.0", script=script)
    assert processes.wait_end(bridge) == 1
    assert "ZeroDivisionError: put in by a test" in bridge.tail()


def test_nothing_that_arrives_ends_the_nodes(nodes: System) -> None:
    attacker = Attacker(nodes.watcher, [nodes.controller, nodes.bridge])
    nodes.watcher.wait_law()
    for attack in ATTACKS:
        attack(attacker)
        attacker.pause()
        attacker.nodes_go_on(attack.__name__)
    nodes.watcher.wait_law()


@pytest.mark.smoke
def test_a_second_controller_is_a_fault_at_once_and_says_how_to_go_on(
    nodes: System, shared_start: Any, shared_processes: Processes
) -> None:
    from sensor_msgs.msg import JointState

    watcher = nodes.watcher
    watcher.wait_law()
    seen: list[float] = []
    watcher.node.create_subscription(JointState, "effort_command", lambda m: seen.append(m.header.stamp.sec), 100)
    foreign = watcher.node.create_publisher(JointState, "effort_command", 10)
    watcher.spin(lambda: foreign.get_subscription_count() >= 2, "the bridge to take foreign commands")
    began = time.monotonic()
    watcher.wait_mode("FAULT", "another publisher")
    assert time.monotonic() - began < PROMPT_S
    assert watcher.modes[-1].endswith("call ~/reset_fault, then ~/enable")
    watcher.node.destroy_publisher(foreign)
    watcher.wait_law()
    second = shared_start("controller", *CONTROLLER_SLOW)  # under the same name
    watcher.wait_mode("FAULT", "another publisher")
    assert nodes.controller.exit_code is None
    assert nodes.bridge.exit_code is None
    shared_processes.stop(second, signal.SIGINT)
