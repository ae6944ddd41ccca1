"""Measurements of the pages: ``python test/system/nodes/measure_signals.py kills|ends``; nothing is asserted.

kills    a recorder of a bridge at 250 Hz is killed (-9) and the next one started at once: until it hears the bridge
ends     SIGINT and SIGTERM at moments of a start, beside busy loops: time until controller, bridge, recorder, run end
"""

from __future__ import annotations

import argparse
import itertools
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from slip_msgs_py.events import EVENTS_VARIABLE, Started, Status
from slip_vic.run.domain import domain_id
from slip_vic.run.node_command import node_command
from slip_vic.run.processes import Child, ProcessGroup, child_environment, python_module
from slip_vic.scenarios.scenario import load_scenario

GIVE_UP_S = 30.0
MOMENTS_S = (0.2, 0.5, 1.0, 1.5, 2.0, 4.0, 15.0)  # at the last a run is on its way, also on a busy machine
ENDLESS = ("bridge.stop_after_duration=false", "bridge.control_period_s=0.004", "controller.control_period_s=0.004")


def recorder(folder: Path, number: int) -> list[str]:
    """Return the command of a recorder into a bag of its own."""
    words = ["record", "--all", "--flush-period", "0.1", "--out", str(folder / f"bag_{number}")]
    return python_module("slip_bags.cli", *words)


def wait(child: Child, kind: type[Started | Status]) -> float:
    """Return how long a child takes from now on until it has begun or heard something [s]."""
    start = time.monotonic()
    while time.monotonic() - start < GIVE_UP_S:
        event = child.last(kind)
        if event is not None and not (isinstance(event, Status) and event.messages == 0):
            break
        time.sleep(0.01)
    return time.monotonic() - start


def kills(rounds: int) -> None:
    """Kill recorders; print how long the next one took to hear the bridge."""
    scenario = load_scenario("paper_planar", mode="realtime", assignments=(*ENDLESS, "bridge.wait_for=[]"))
    took = []
    with domain_id() as domain, tempfile.TemporaryDirectory() as scratch, ProcessGroup() as group:
        folder, environment = Path(scratch), child_environment(domain)
        bridge = group.start("bridge", node_command("bridge", scenario.bridge, folder), environment, lambda *_: None)
        wait(bridge, Started)
        for number in range(rounds):
            child = group.start("recorder", recorder(folder, number), environment, lambda *_: None)
            took.append(wait(child, Status))
            child.send(signal.SIGKILL)
            child.wait(GIVE_UP_S)
    later = took[1:]
    deaf = sum(each >= GIVE_UP_S for each in later)
    print(
        f"{len(later)} starts at once after a kill -9: heard after {statistics.median(later):.1f} s (median), "
        f"{max(later):.1f} s (longest); {deaf} heard nothing in {GIVE_UP_S:g} s"
    )


def ends(busy: int, only: Sequence[str]) -> None:
    """Signal processes at moments of their start; print how long each took to end, and its exit code."""
    scenario = load_scenario("paper_planar", mode="realtime", assignments=ENDLESS)
    of_run = [word for assignment in ENDLESS for word in ("--set", assignment)]
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(busy)]
    try:
        with domain_id() as domain, tempfile.TemporaryDirectory() as scratch:
            folder, environment = Path(scratch), child_environment(domain)
            del environment[EVENTS_VARIABLE]  # as a user starts them
            run = python_module("slip_vic.cli", "run", "--mode", "realtime", *of_run)
            commands: dict[str, Callable[[int], list[str]]] = {
                "controller": lambda _: node_command("controller", scenario.controller, folder),
                "bridge": lambda _: node_command("bridge", scenario.bridge, folder),
                "recorder": lambda number: recorder(folder, number),
                "run": lambda _: run,
                "run --record": lambda number: [*run, "--record", str(folder / f"bag_{number}")],
            }
            numbers = itertools.count()
            for what, how in itertools.product(only or commands, (signal.SIGINT, signal.SIGTERM)):
                row = [
                    end_of(what, commands[what](next(numbers)), environment, how, moment_s) for moment_s in MOMENTS_S
                ]
                print(f"| {what} | {how.name} | " + " | ".join(row) + " |", flush=True)
    finally:
        for loop in loops:
            loop.kill()


def end_of(what: str, command: list[str], environment: Mapping[str, str], how: signal.Signals, moment_s: float) -> str:
    """Start a process and signal it after so long; return how long it took to end [s], and its exit code."""
    with ProcessGroup() as group:
        child = group.start(what, command, environment, lambda *_: None)
        time.sleep(moment_s)
        start = time.monotonic()
        child.send(how)
        child.wait(GIVE_UP_S)
        return f"{time.monotonic() - start:.1f} ({child.exit_code})"


def main() -> None:
    """Run the measurement that was asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["kills", "ends"])
    parser.add_argument("--rounds", type=int, default=40, help="kills: how many recorders")
    parser.add_argument("--busy", type=int, default=4, help="ends: busy loops beside it")
    parser.add_argument("--only", action="append", default=[], help="ends: names of rows, as they are printed")
    arguments = parser.parse_args()
    if arguments.what == "kills":
        kills(arguments.rounds)
    else:
        ends(arguments.busy, arguments.only)


if __name__ == "__main__":
    main()
