"""The launcher: first failing child reported with its last lines, nothing left behind, every mode runs."""

import contextlib
import os
import signal
import threading
import time
from pathlib import Path

import psutil
import pytest

from slip_bags.reader import Bag
from slip_core.errors import InputError, ProtocolError
from slip_vic.run.launcher import Launcher
from slip_vic.scenarios.scenario import load

DEADLINE_S = 90.0


def node_children(word: str = "slip_") -> list[psutil.Process]:
    found = []
    for child in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):  # it has ended since it was listed
            if word in " ".join(child.cmdline()):
                found.append(child)
    return found


def kill_when_running(module: str, number: int) -> threading.Thread:
    """Send a signal to the child that runs `module` once the bridge has begun to report."""

    def work() -> None:
        end = time.monotonic() + DEADLINE_S
        while time.monotonic() < end:
            found = node_children(module)
            if found and len(node_children()) >= 2:
                time.sleep(1.5)
                found[0].send_signal(number)
                return
            time.sleep(0.02)

    thread = threading.Thread(target=work)
    thread.start()
    return thread


def test_a_recorder_that_sleeps_for_a_while_loses_nothing(tmp_path: Path) -> None:
    """A machine with other work does that to it; its queues and those of the publishers hold what comes meanwhile."""
    scenario = load("paper_planar", law="vic", set=["bridge.duration_s=3.0"])
    waking: list[threading.Timer] = []

    def sleep(sim_time_s: float) -> None:
        if sim_time_s > 0.2 and not waking:
            (recorder,) = node_children("slip_bags.cli")
            recorder.suspend()
            waking.append(threading.Timer(1.5, recorder.resume))
            waking[0].start()

    result = Launcher(scenario, bag=tmp_path / "bag").run(sleep)
    waking[0].join()
    assert result.lost == 0
    bag = Bag(tmp_path / "bag")
    for topic in ("/joint_states", "/effort_command", "/controller/ledger"):
        assert bag.topics[topic].message_count == result.ticks == 3000, topic


@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("slip_vic_controller.main", "controller failed with exit code -9"),
        ("slip_sim_bridge.main", "bridge failed with exit code -9"),
        ("slip_bags.cli", "recorder failed with exit code -9"),
    ],
)
def test_a_killed_child_is_named_and_the_others_end(module: str, words: str, tmp_path: Path) -> None:
    scenario = load("paper_planar", law="vic", set=["bridge.duration_s=1000.0"])
    thread = kill_when_running(module, signal.SIGKILL)
    with pytest.raises(ProtocolError, match=words):
        Launcher(scenario, bag=tmp_path / "bag").run()
    thread.join()
    assert node_children() == []


@pytest.mark.smoke
def test_a_signal_ends_the_run_and_keeps_a_whole_bag(tmp_path: Path) -> None:
    scenario = load("paper_planar", law="vic", set=["bridge.duration_s=1000.0"])

    def interrupt(sim_time_s: float) -> None:
        if sim_time_s > 0.02:
            os.kill(os.getpid(), signal.SIGTERM)

    with pytest.raises(InputError, match="interrupted: got a signal after"):
        Launcher(scenario, bag=tmp_path / "bag").run(interrupt)
    assert node_children() == []
    bag = Bag(tmp_path / "bag")
    assert bag.topics["/joint_states"].message_count > 0
    assert set(bag.attachments) == {"arm.urdf", "scenario.yaml", "controller.params.yaml", "bridge.params.yaml"}


def test_nobody_waits_for_a_wrench_sensor_that_the_arm_does_not_have(tmp_path: Path) -> None:
    told = ("controller.wrench.source=none", "bridge.duration_s=0.1")
    result = Launcher(load("paper_planar", law="governed", set=told), bag=tmp_path / "bag").run()
    assert result.lost == 0
    bag = Bag(tmp_path / "bag")
    assert "ACTIVE" in [message.value.data.split(":")[0] for message in bag.messages("/controller/mode")]
