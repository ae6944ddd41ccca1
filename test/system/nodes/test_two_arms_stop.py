"""Two arms over DDS that are stopped, by a user or by what goes wrong at one of them: both, together, the pane held.

In lockstep a busy machine is slow, and nothing else: what happens between two services does not depend on it.
"""

from __future__ import annotations

import signal
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
from slip_vic.scenarios.scenario import Scenario, load
from slip_vic_controller.safety.conditions import Mode
from test.support.ros import Processes, wait_until
from test.system.nodes.test_modes import Watcher

SIDES = ("left", "right")
ASSIGNMENTS = (
    "bridge.duration_s=1e6",
    "bridge.lockstep_timeout_s=60.0",
    "bridge.peer_timeout_s=60.0",
    "controller.trajectory.start_s=0.0",
    "controller.trajectory.duration_s=6.0",
    "controller.safety.resume_after_s=0.1",
)


@pytest.fixture
def arms(ros_node: Any) -> list[Watcher]:
    return [Watcher(ros_node, f"{side}/") for side in SIDES]


def wait_modes(arms: list[Watcher], left: str, right: str) -> None:
    """Wait until the present modes have these words in them."""
    at = lambda: all(arm.modes and word in arm.modes[-1] for word, arm in zip((left, right), arms, strict=True))  # noqa: E731
    arms[0].spin(at, f"{left}, {right}; the right arm after {arms[1].modes}")


def spoil(watcher: Watcher, name: str, value: bool) -> None:
    """Set a parameter of the bridge."""
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    answer = watcher.call(SetParameters, "/slip_sim_bridge/set_parameters", request)
    assert answer.results[0].successful, answer.results[0].reason


def modes_of(bag: Bag, side: str) -> dict[int, Mode]:
    """Return the mode of every cycle of an arm, by the stamp of its joint state."""
    rows = (tuple(message.value.data) for message in bag.messages(f"/{side}/controller/ledger"))
    return {row[1] * 1_000_000_000 + row[2]: Mode(row[-3]) for row in rows}


def start_nodes(scenario: Scenario, processes: Processes, folder: Path) -> tuple[Child, Child]:
    """Start controller and bridge, and wait until the run begins."""
    nodes = []
    for name in ("controller", "bridge"):
        nodes.append(processes.start(name, node_command(name, getattr(scenario, name), folder)))
    wait_until(lambda: nodes[1].last.get("progress") is not None, "the bridge")
    return nodes[0], nodes[1]


def stop_and_go_on(arms: list[Watcher]) -> None:
    """Hold as a user; fall silent at one arm; interfere with the other one: each time both stop, and go on."""
    left, _ = arms
    wait_modes(arms, "ACTIVE", "ACTIVE")
    assert left.trigger("hold").success
    wait_modes(arms, "HOLD: hold requested", "HOLD: hold requested")
    assert left.trigger("enable").success
    wait_modes(arms, "ACTIVE", "ACTIVE")
    spoil(left, "right.sensors.wrench.silent", True)
    wait_modes(arms, "HOLD", "HOLD: wrench")
    spoil(left, "right.sensors.wrench.silent", False)
    wait_modes(arms, "ACTIVE", "ACTIVE")
    left.interfere("left/effort_command", lambda: wait_modes(arms, "FAULT", "HOLD"))
    wait_modes(arms, "ACTIVE", "ACTIVE")


@pytest.fixture
def recorded(arms: list[Watcher], processes: Processes, tmp_path: Path) -> tuple[Path, Run]:
    """Run both nodes in lockstep with a recorder, and stop them in every way."""
    prepare()
    scenario = load("pane_two_arms_upright", law="vic", set=(*ASSIGNMENTS, "expected_subscribers=2"))
    bag = tmp_path / "bag"
    recorder = processes.start("recorder", recorder_command(scenario, bag, tmp_path, ""))
    controller, bridge = start_nodes(scenario, processes, tmp_path)
    stop_and_go_on(arms)
    for child in (bridge, controller, recorder):
        assert processes.stop(child, signal.SIGINT) == 0, child.tail()
    return bag, judge_bag(bag, scenario)


@pytest.mark.timeout(600)
def test_both_arms_stop_together(recorded: tuple[Path, Run]) -> None:
    path, judged = recorded
    bag = Bag(path)
    left, right = (modes_of(bag, side) for side in SIDES)
    assert left.keys() == right.keys()
    together = {(left[stamp].follows, right[stamp].follows) for stamp in left}
    assert together == {(True, True), (False, False)}
    assert {Mode.HOLD, Mode.FAULT} <= set(left.values())
    assert Mode.FAULT not in right.values()
    assert verify_run(read_run(bag)).identical
    assert judged.worst("slip_linear_peak_m") < 1e-4
    assert judged.internal_force_n < 0.6  # N: a tenth of what friction of one pad bears
