"""`slip-vic bringup` over DDS on bridge and controller that run: first all is well, then one thing is wrong."""

from __future__ import annotations

import signal
import time
from pathlib import Path
from typing import Any

import pytest

from slip_sim_bridge.params import BridgeParams
from slip_vic.scenarios.scenario import load, read_parameters
from slip_vic.setup.bringup.hands import Simulated
from slip_vic.setup.bringup.heard import BRIDGE
from slip_vic.setup.bringup.walk import Walk
from test.support.bringup_arm import BRINGUP
from test.support.ros import Processes, wait_until

ARM = "left"
SLOWER = ("control_period_s=0.004",)  # fewer ticks: this test is about topics and services
SENSOR = ("bridge.sensors.slip.rate_hz=120.0", "bridge.sensors.slip.latency_s=0.01")


def run_bringup(processes: Processes, out: Path) -> tuple[int, str]:
    command = ("-m", "slip_vic.cli", "bringup", "--simulated", "--namespace", ARM, "--out", out)
    child = processes.python("bringup", *command)
    wait_until(lambda: child.poll() is not None, "the end of the bring-up", 150.0, seen=child.tail)
    return int(child.poll() or 0), child.tail()


@pytest.mark.smoke
def test_a_healthy_system_is_led_to_its_first_motion_and_an_error_is_found(
    processes: Processes, ros_node: Any, tmp_path: Path
) -> None:
    from slip_vic.setup.bringup.ros_system import RosSystem

    words = [word for assignment in (*BRINGUP, *SLOWER, *SENSOR) for word in ("--set", assignment)]
    running = processes.python("run", "-m", "slip_vic.cli", "run", "--namespace", ARM, *words)
    wait_until(lambda: ros_node.count_publishers(f"/{ARM}/joint_states") == 1, "the bridge", seen=running.tail)
    out = tmp_path / "measured.yaml"
    code, said = run_bringup(processes, out)
    assert code == 0, said
    measured = read_parameters(out)
    assert abs(measured["slip_sensor.rate_hz"] - 120.0) < 2.0
    assert abs(measured["slip_sensor.latency_s"] - 0.01) < 8e-3
    known = load("paper_planar", law="vic", parameters=measured).controller
    assert known.slip_sensor.latency_s == measured["slip_sensor.latency_s"]

    system = RosSystem(ros_node, ARM)
    meanwhile = system.listen(0.1, lambda: time.sleep(1.0)).joints.stamp
    assert meanwhile[-1] - meanwhile[0] > 0.12, "what comes while something is begun is heard too"
    system.tune({"sensors.slip.faults.bias": [0.02, 0.0, 0.0, 0.0, 0.0, 0.0]}, BRIDGE)
    hand = Simulated(system, system.parameters(BridgeParams, BRIDGE))
    last = list(Walk(system, hand).steps())[-1]
    assert last.step == "rest"
    assert "calibrate it" in last.fix
    processes.stop(running, signal.SIGINT)
