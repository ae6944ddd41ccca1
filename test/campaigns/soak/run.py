"""Runs bridge, controller and recorder in real time, with an operator, and looks at their processes now and then."""

from __future__ import annotations

import contextlib
import json
import math
import os
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from slip_core.errors import ProtocolError
from slip_msgs_py.events import Event, Started, Warned
from slip_vic.run.domain import domain_id
from slip_vic.run.node_command import node_command, run_parameters
from slip_vic.run.processes import Child, ProcessGroup, child_environment
from slip_vic.run.recording import recorder_command
from slip_vic.scenarios.scenario import Scenario, load_scenario
from test.campaigns.operator import Operator, operator_of
from test.campaigns.soak.growth import Limits, ProcessGrowth, Sample, growth_of

START_S = 30.0
SAMPLES = 360
SHORTEST_S = 0.5
LOOK_S = 0.2
SPLIT_S = 300.0  # the bag goes on in a new file, as a long recording should: a file's index is kept in memory


@dataclass
class SoakResult:
    """Samples of every process, and what bridge and controller said at their end."""

    minutes: float
    rate_hz: float
    samples: dict[str, list[Sample]] = field(default_factory=dict)
    said: dict[str, Mapping[str, Any]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)
    objects_lost: int = 0

    def growth(self) -> dict[str, ProcessGrowth]:
        """Return the growth of every process."""
        return {name: growth_of(samples) for name, samples in self.samples.items()}

    def law_share(self) -> float:
        """Return the share of cycles in which the law was at work; NaN where the recorder has not said."""
        topics = self.said.get("recorder", {}).get("topics", {})
        law, all_of_them = (
            topics.get(f"/controller/{name}", {}).get("messages", 0) for name in ("stiffness", "scalars")
        )
        return law / all_of_them if all_of_them else math.nan

    def summary(self, limits: Limits) -> dict[str, Any]:
        """Return what soak.json holds."""
        growth = self.growth()
        return {
            "minutes": self.minutes,
            "rate_hz": self.rate_hz,
            "law_share": self.law_share(),
            "faults": self.faults,
            "objects_lost": self.objects_lost,
            "samples": len(next(iter(self.samples.values()), [])),
            "growth": {name: grown.as_dict() for name, grown in growth.items()},
            "grows": {name: words for name, grown in growth.items() if (words := grown.grows(limits))},
            "said": {name: dict(values) for name, values in self.said.items()},
            "warnings": self.warnings,
        }


def soak_scenario(name: str, minutes: float, rate_hz: float) -> Scenario:
    """Return a scenario that goes on for that long: a lemniscate round after round, with the observer."""
    period_s = 1.0 / rate_hz
    seconds = 60.0 * minutes
    return load_scenario(
        name,
        mode="realtime",
        assignments=(
            f"controller.control_period_s={period_s}", f"bridge.control_period_s={period_s}",
            "controller.slip_estimator=observer", "bridge.grip.force=2.0", "controller.trajectory.kind=lemniscate",
            "controller.trajectory.radius=0.06", f"controller.trajectory.duration_s={seconds + 60.0}",
            "bridge.stop_after_duration=false",
        ),
    )  # fmt: skip


def run_soak(scenario: Scenario, minutes: float, on_time: Callable[[float], None]) -> SoakResult:
    """Run for so many minutes of real time; `on_time` gets the seconds since the start.

    Raises:
        ProtocolError: a process ended before its time.
    """
    result = SoakResult(minutes, 1.0 / scenario.bridge.control_period_s)
    with (
        domain_id() as domain,
        tempfile.TemporaryDirectory(prefix="slip_vic_soak_") as folder,
        ProcessGroup() as group,
        operator_of(domain) as operator,
    ):
        children = _start(group, scenario, child_environment(domain), Path(folder), result)
        deadline = time.monotonic() + START_S
        while children["bridge"].last(Started) is None:
            group.check()
            if time.monotonic() > deadline:
                raise ProtocolError(f"bridge did not start within {START_S:g} s:\n{children['bridge'].tail()}")
            time.sleep(LOOK_S)
        _watch(group, children, result, on_time, operator)
        result.faults, result.objects_lost = operator.faults, operator.objects_lost
        for name in ("bridge", "controller", "recorder"):
            group.stop([children[name]])
            result.said[name] = children[name].results
        group.check()
    return result


def _start(
    group: ProcessGroup, scenario: Scenario, environment: dict[str, str], folder: Path, result: SoakResult
) -> dict[str, Child]:
    controller, bridge = run_parameters(scenario, recording=True)
    recorder = recorder_command(scenario, folder / "bag", folder, "")
    commands = {"recorder": [*recorder, "--max-bag-duration", str(SPLIT_S)]}
    for name, params in (("controller", controller), ("bridge", bridge)):
        commands[name] = node_command(name, params, folder)

    def on_event(name: str, event: Event) -> None:
        if isinstance(event, Warned):
            result.warnings.append(f"{name}: {event.text}")

    return {name: group.start(name, command, environment, on_event) for name, command in commands.items()}


def _watch(
    group: ProcessGroup,
    children: Mapping[str, Child],
    result: SoakResult,
    on_time: Callable[[float], None],
    operator: Operator,
) -> None:
    seconds = 60.0 * result.minutes
    every_s = max(seconds / SAMPLES, SHORTEST_S)
    watched = {name: psutil.Process(child.pid) for name, child in children.items()}
    watched["soak"] = psutil.Process()
    start = time.monotonic()
    next_sample = 0.0
    while (t := time.monotonic() - start) < seconds:
        group.check()
        on_time(t)
        if t >= next_sample:
            next_sample += every_s
            for name, process in watched.items():
                with contextlib.suppress(psutil.NoSuchProcess):
                    result.samples.setdefault(name, []).append(sample_process(process, t))
        operator.attend(min(LOOK_S, every_s))
    on_time(seconds)


def sample_process(process: psutil.Process, t: float) -> Sample:
    """Look at a process now, t [s] after the start."""
    with process.oneshot():
        return Sample(t, process.memory_info().rss, process.num_fds(), process.num_threads())


def write_result(out: Path, result: SoakResult, limits: Limits) -> Path:
    """Write soak.json, with every sample; return its path."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / "soak.json"
    content = result.summary(limits)
    content["series"] = {
        name: [[round(s.t, 1), s.rss, s.files, s.threads] for s in samples] for name, samples in result.samples.items()
    }
    temporary = path.with_suffix(".tmp")
    temporary.write_text(json.dumps(content) + "\n", encoding="utf-8")
    os.replace(temporary, path)
    return path
