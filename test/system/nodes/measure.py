"""Measurements of the pages: ``python test/system/nodes/measure.py starts|slip|late|fresh``; nothing is asserted.

starts   start bridge and controller, stop them with SIGINT after a moment: exit codes, time to stop, files left behind
slip     how much the object slips in real time and in lockstep, several runs
late     how much the object slips in process where every command is some control periods late, by what spin does
fresh    a long run in real time, with the recorder or without: fresh ticks, missed states, latency, messages lost
"""

from __future__ import annotations

import argparse
import random
import signal
import statistics
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from slip_msgs_py.events import Started
from slip_msgs_py.realtime import ProcessOptions
from slip_vic.run.domain import domain_id
from slip_vic.run.in_process import run_in_process
from slip_vic.run.launcher import Launcher
from slip_vic.run.metrics import summarise
from slip_vic.run.node_command import node_command
from slip_vic.run.processes import ProcessGroup, child_environment
from slip_vic.run.series import read_series
from slip_vic.scenarios.scenario import BOUNDED, Scenario, load_scenario
from slip_vic_controller.safety.modes import Mode
from test.campaigns.faults.monitors import LOST_M

START_S, STOP_S = 60.0, 10.0


def starts(times: int, seed: int) -> None:
    """Start and stop both nodes so many times, at a random moment of a run in real time."""
    scenario, moments = load_scenario("paper_planar", mode="realtime"), random.Random(seed)
    took, codes = [], []
    for number in range(times):
        with domain_id() as domain, tempfile.TemporaryDirectory() as folder, ProcessGroup() as group:
            environment = child_environment(domain)
            bridge = scenario.bridge.model_copy(update={"wait_for": ("controller",)})
            children = {}
            for name, params in (("controller", scenario.controller), ("bridge", bridge)):
                command = node_command(name, params, Path(folder))
                children[name] = group.start(name, command, environment, lambda _name, _event: None)
            deadline = time.monotonic() + START_S
            while children["bridge"].last(Started) is None and time.monotonic() < deadline:
                time.sleep(0.02)
            time.sleep(moments.uniform(0.0, 0.5))
            began = time.monotonic()
            for child in children.values():
                child.send(signal.SIGINT)
            for child in children.values():
                child.wait(STOP_S)
            took.append(time.monotonic() - began)
            codes += [child.exit_code for child in children.values()]
            for name, child in children.items():
                if child.exit_code != 0:
                    print(f"\n{name}: exit code {child.exit_code}; last lines:\n{child.tail()}")
        print(f"\r{number + 1}/{times}", end="", flush=True)
    print(
        f"\n{times} starts and stops: exit codes other than 0: {sum(code != 0 for code in codes)}; both stopped after "
        f"{1e3 * statistics.median(took):.0f} ms (median), {1e3 * max(took):.0f} ms (longest); "
        f"above 300 ms: {sum(t > 0.3 for t in took)}"
    )


def slip(runs: int, fifo: int | None) -> None:
    """Compare the slip of paper_planar in real time with that in lockstep."""
    found: dict[str, list[float]] = {"lockstep": [], "realtime": []}
    for number in range(runs + 1):
        mode = "realtime" if number else "lockstep"
        with tempfile.TemporaryDirectory() as folder:
            process = ProcessOptions(fifo=fifo) if number else ProcessOptions()
            result = Launcher(scenario_in(mode, None), bag=Path(folder) / "bag", process=process).run()
            metrics = summarise(read_series(Path(folder) / "bag"))
        found[mode].append(metrics["slip_linear_m"])
        print(f"{mode}: {1e3 * metrics['slip_linear_m']:.3f} mm", *timing_words(result.timing))
    ratios = [value / found["lockstep"][0] for value in found["realtime"]]
    print(f"real time / lockstep: {', '.join(f'{ratio:.3f}' for ratio in ratios)}")


def late() -> None:
    """Compare the slip of paper_planar with commands that are late."""
    for spin in ("follow", "bounded"):
        for ticks in range(4):
            scenario = load_scenario("paper_planar", assignments=(f"controller.gains.spin={spin}",))
            largest, works = 0.0, True
            for tick in run_in_process(scenario, ticks):
                largest = max(largest, float(np.abs(tick.outputs.truth.slip_displacement[:3]).max()))
                works = works and tick.result.mode == Mode.ACTIVE
                if largest > LOST_M:
                    break
            words = f"{1e3 * largest:.2f} mm" if largest < LOST_M else "lost"
            print(f"spin {spin}, {ticks} ms late: largest slip {words}{'' if works else ', the law gave up'}")


def fresh(seconds: float, rate_hz: float, fifo: int | None, records: bool) -> None:
    """Run for so long in real time, with the recorder as a third process or without."""
    scenario = scenario_in("realtime", seconds, rate_hz)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag" if records else None
        result = Launcher(scenario, bag=bag, process=ProcessOptions(fifo=fifo)).run()
    print(f"{rate_hz:g} Hz, {seconds:g} s, {'SCHED_FIFO' if fifo else 'unprivileged'}: {result.ticks} ticks;", end=" ")
    print(*timing_words(result.timing), f"{result.messages} messages, {result.lost} lost" if records else "no recorder")


def scenario_in(mode: str, seconds: float | None, rate_hz: float = 1000.0) -> Scenario:
    """Return paper_planar in a mode, for so many seconds at a control rate."""
    period = 1.0 / rate_hz
    changes = [f"controller.control_period_s={period}", f"bridge.control_period_s={period}"]
    if seconds is not None:
        changes.append(f"bridge.duration_s={seconds}")
    changes += [f"controller.{name}={value}" for name, value in BOUNDED.items()]  # the same law in both modes
    return load_scenario("paper_planar", mode=mode, assignments=tuple(changes))


def timing_words(timing: Mapping[str, float]) -> list[str]:
    """Return what a real-time run says of its timing."""
    if not timing:
        return []
    return [
        f"fresh {100.0 * timing['fresh_share']:.3f} %, missed {timing['missed']:.0f}, latency",
        " / ".join(f"{key} {1e3 * timing[f'latency_{key}_s']:.2f}" for key in ("p50", "p99", "max")) + " ms;",
    ]


def main() -> None:
    """Run one measurement."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["starts", "slip", "late", "fresh"])
    parser.add_argument("--times", type=int, default=100)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--fifo", type=int)
    parser.add_argument("--no-recorder", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    words = parser.parse_args()
    if words.what == "starts":
        starts(words.times, words.seed)
    elif words.what == "slip":
        slip(words.runs, words.fifo)
    elif words.what == "late":
        late()
    else:
        fresh(words.seconds, words.rate, words.fifo, not words.no_recorder)


if __name__ == "__main__":
    main()
