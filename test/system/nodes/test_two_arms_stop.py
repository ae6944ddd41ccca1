"""Two arms over DDS that are stopped, by a user or by what goes wrong at one of them: both, together, the pane held.

In lockstep a busy machine is slow, and nothing else: what happens between two services does not depend on it.
"""

from __future__ import annotations

import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from slip_bags.reader import Bag
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.commands import node_command, recorder_command
from slip_vic.run.judge import judge_bag
from slip_vic.run.prepare import prepare
from slip_vic.run.processes import Child
from slip_vic.run.run import Run
from slip_vic.scenarios.scenario import Scenario, load_scenario
from slip_vic_controller.safety.modes import Mode
from test.support.ros import Processes, call_service, wait_until
from test.system.nodes.test_modes import LATCHED

SIDES = ("left", "right")
ASSIGNMENTS = (
    "bridge.duration_s=1e6",
    "bridge.lockstep_timeout_s=60.0",
    "bridge.peer_timeout_s=60.0",
    "controller.trajectory.start_s=0.0",
    "controller.trajectory.duration_s=6.0",
    "controller.safety.resume_after_s=0.1",
)
STARTS_S, CHANGES_S = 90.0, 60.0
NODE, BRIDGE = "/slip_vic_controller", "/slip_sim_bridge"


class Operator:
    """Sees the modes of both arms, asks for others, and spoils what one arm measures."""

    def __init__(self, node: Any) -> None:
        from rclpy.executors import SingleThreadedExecutor
        from std_msgs.msg import String

        self.node, self.modes = node, [["none"], ["none"]]
        for side, seen in zip(SIDES, self.modes, strict=True):
            node.create_subscription(String, f"{side}/controller/mode", lambda m, s=seen: s.append(m.data), LATCHED)
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)

    def wait(self, condition: Callable[[], bool], what: str, timeout_s: float = CHANGES_S) -> None:
        """Spin until something is so."""
        seen = lambda: f"after {self.modes}"  # noqa: E731
        wait_until(lambda: self._executor.spin_once(0.02) or condition(), what, timeout_s, seen)

    def wait_modes(self, left: str, right: str, timeout_s: float = CHANGES_S) -> None:
        """Wait until the present modes have these words in them."""
        wanted = (left, right)
        self.wait(
            lambda: all(word in seen[-1] for word, seen in zip(wanted, self.modes, strict=True)), f"{wanted}", timeout_s
        )

    def trigger(self, name: str) -> bool:
        """Call a service of the controller."""
        from std_srvs.srv import Trigger

        return bool(call_service(self.node, Trigger, f"{NODE}/{name}", Trigger.Request(), self.wait).success)

    def spoil(self, name: str, value: bool) -> None:
        """Set a parameter of the bridge."""
        from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
        from rcl_interfaces.srv import SetParameters

        given = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value)
        request = SetParameters.Request(parameters=[Parameter(name=name, value=given)])
        answer = call_service(self.node, SetParameters, f"{BRIDGE}/set_parameters", request, self.wait)
        assert answer.results[0].successful, answer.results[0].reason


@pytest.fixture
def operator(ros_node: Any) -> Operator:
    return Operator(ros_node)


def modes_of(bag: Bag, side: str) -> dict[int, Mode]:
    """Return the mode of every cycle of an arm, by the stamp of its joint state."""
    rows = (tuple(message.value.data) for message in bag.messages(f"/{side}/controller/ledger"))
    return {row[1] * 1_000_000_000 + row[2]: Mode(row[-3]) for row in rows}


def start_nodes(scenario: Scenario, processes: Processes, folder: Path) -> tuple[Child, Child]:
    """Start controller and bridge, and wait until the run begins."""
    nodes = []
    for name in ("controller", "bridge"):
        nodes.append(processes.start(name, node_command(name, getattr(scenario, name), folder)))
    wait_until(lambda: nodes[1].last("started") is not None, "the bridge", STARTS_S)
    return nodes[0], nodes[1]


def stop_and_go_on(operator: Operator) -> None:
    """Hold as a user; fall silent at one arm; interfere with the other one: each time both stop, and go on."""
    from sensor_msgs.msg import JointState

    operator.wait_modes("ACTIVE", "ACTIVE", STARTS_S)
    assert operator.trigger("hold")
    operator.wait_modes("HOLD: hold requested", "HOLD: hold requested")
    assert operator.trigger("enable")
    operator.wait_modes("ACTIVE", "ACTIVE")
    operator.spoil("right.sensors.wrench.silent", True)
    operator.wait_modes("HOLD", "HOLD: wrench")
    operator.spoil("right.sensors.wrench.silent", False)
    operator.wait_modes("ACTIVE", "ACTIVE")
    foreign = operator.node.create_publisher(JointState, "left/effort_command", 1)
    operator.wait_modes("FAULT", "HOLD")
    operator.node.destroy_publisher(foreign)
    assert not operator.trigger("enable")
    ours = lambda: len(operator.node.get_publishers_info_by_topic("/left/effort_command")) == 1  # noqa: E731
    operator.wait(ours, "the foreign publisher to go")
    operator.wait(lambda: operator.trigger("reset_fault") and "HOLD" in operator.modes[0][-1], "HOLD after the reset")
    assert operator.trigger("enable")
    operator.wait_modes("ACTIVE", "ACTIVE")


@pytest.fixture
def recorded(operator: Operator, processes: Processes, tmp_path: Path) -> tuple[Path, Run]:
    """Run both nodes in lockstep with a recorder, while an operator stops them in every way."""
    prepare()
    scenario = load_scenario("pane_two_arms_upright", assignments=(*ASSIGNMENTS, "expected_subscribers=2"))
    bag = tmp_path / "bag"
    recorder = processes.start("recorder", recorder_command(scenario, bag, tmp_path, ""))
    controller, bridge = start_nodes(scenario, processes, tmp_path)
    stop_and_go_on(operator)
    for child in (bridge, controller, recorder):
        assert processes.stop(child, signal.SIGINT) == 0, child.tail()
    return bag, judge_bag(bag, scenario)


@pytest.mark.timeout(600)
def test_both_arms_stop_together(
    recorded: tuple[Path, Run],
) -> None:
    path, judged = recorded
    with Bag(path) as bag:
        left, right = (modes_of(bag, side) for side in SIDES)
        assert left.keys() == right.keys()
        together = {(left[stamp].follows, right[stamp].follows) for stamp in left}
        assert together == {(True, True), (False, False)}
        assert {Mode.HOLD, Mode.FAULT} <= set(left.values())
        assert Mode.FAULT not in right.values()
        assert verify_run(read_run(bag)).identical
    assert judged.worst("slip_linear_peak_m") < 1e-4
    assert judged.internal_force_n < 0.6  # N: a tenth of what friction of one pad bears
