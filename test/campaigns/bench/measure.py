"""The whole bench: rounds of everything side by side, then free running; the numbers as data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from slip_msgs_py.realtime import ProcessOptions
from slip_vic.scenarios.scenario import load_scenario
from test.campaigns.bench import cost, dds
from test.campaigns.bench.machine import calibration_s, fifo_permitted, machine
from test.campaigns.bench.samples import Metric, Rounds, relative_spread, rotated

FIFO_PRIORITY = 80
RATES_HZ = (500, 1000, 2000)
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Effort:
    """How long to measure: rounds, round trips and lockstep time per round, and seconds of each free run."""

    rounds: int = 5
    round_trips: int = 1500
    lockstep_s: float = 1.5
    loop_ticks: int = 1500
    turns: int = 600
    free_s: float = 10.0


QUICK = Effort(rounds=2, round_trips=300, lockstep_s=0.3, loop_ticks=200, turns=60, free_s=1.0)


@dataclass(frozen=True, slots=True)
class BenchResult:
    """Metrics by name, the free runs, the machine, and how much its speed varied between rounds."""

    metrics: dict[str, Metric]
    free_running: dict[str, dict[str, float]]
    memory_mib: dict[str, float]
    machine: dict[str, Any]
    noise: float
    notes: list[str]

    def as_dict(self) -> dict[str, Any]:
        """Return it for ``bench.json``; the figures that are asked for by name stand at the top."""
        top = (
            "control_step_ratio",
            "control_step_observer_ratio",
            "supervised_loop_real_time_factor",
            "lockstep_ratio",
        )
        return {
            **{name: self.metrics[name].median for name in top if name in self.metrics},
            "free_running": self.free_running,
            "metrics": {name: metric.as_dict() for name, metric in self.metrics.items()},
            "memory_mib": self.memory_mib,
            "machine": self.machine,
            "noise": self.noise,
            "notes": self.notes,
        }


def run_bench(effort: Effort, say: Say) -> BenchResult:
    """Measure everything; `say` gets each stage."""
    notes: list[str] = []
    found = machine()
    rounds = _rounds(effort, say)
    say("free running")
    free, memory = _free_running(effort, notes)
    return BenchResult(
        metrics=_metrics(rounds),
        free_running=free,
        memory_mib=memory,
        machine=found,
        noise=relative_spread(rounds.values["calibration"]),
        notes=notes,
    )


def _rounds(effort: Effort, say: Say) -> Rounds:
    rounds = Rounds()
    scenario = dds.lockstep_scenario(effort.lockstep_s)
    vic = load_scenario(cost.SCENARIO)
    step = cost.stretch(vic)
    pieces: dict[str, cost.Call | cost.Stretch] = {
        "control step": step,
        "pinocchio terms": cost.bare_terms(step.session.controller.first.robot, step.inputs[0].joint),
    }
    pieces["control step, observer"] = cost.stretch(cost.observer_scenario())
    pieces["control step, governed"] = cost.stretch(cost.governed_scenario())
    for name, drive in (("estimator", "torque_joint"), ("velocity", "velocity_500")):
        pieces[f"control step, {name}"] = cost.stretch(cost.governed_scenario(drive))
    measures: dict[str, Callable[[], float]] = {
        "r0": lambda: dds.round_trip_s(effort.round_trips),
        "lockstep": lambda: dds.lockstep_tick_s(scenario),
        "lockstep, recorded": lambda: dds.lockstep_tick_s(scenario, record=True),
        "supervised loop": lambda: cost.supervised_loop_factor(vic, effort.loop_ticks),
    }
    for number in range(effort.rounds):
        say(f"round {number + 1} of {effort.rounds}")
        rounds.add("calibration", calibration_s())
        for name, value in cost.interleaved(pieces, effort.turns).items():
            rounds.add(name, value)
        for name in rotated(list(measures), number):
            rounds.add(name, measures[name]())
    return rounds


def _metrics(rounds: Rounds) -> dict[str, Metric]:
    ratio, bare, before = rounds.ratio, "pinocchio terms", "control step, governed"

    def microseconds(name: str, source: str) -> Metric:
        return rounds.metric(name, source, "us", scale=1e6)

    metrics = [
        ratio("control_step_ratio", "control step", bare, "control step / Pinocchio terms it needs"),
        ratio("control_step_observer_ratio", "control step, observer", bare, "the same with slip observer"),
        ratio("control_step_governed_ratio", "control step, governed", bare, "the same with reference governor"),
        ratio("estimator_ratio", "control step, estimator", before, "with / without joint state estimator"),
        ratio("velocity_ratio", "control step, velocity", before, "commands of velocities / efforts"),
        rounds.metric("supervised_loop_real_time_factor", "supervised loop", "x", "simulator, sensors, whole cycle"),
        ratio("lockstep_ratio", "r0", "lockstep", "R0 round trip / lockstep tick, two processes"),
        ratio("recorder_ratio", "lockstep, recorded", "lockstep", "lockstep tick with / without recorder"),
        microseconds("pinocchio_terms_us", bare),
        microseconds("control_step_us", "control step"),
        microseconds("control_step_governed_us", "control step, governed"),
        microseconds("r0_us", "r0"),
        microseconds("lockstep_tick_us", "lockstep"),
    ]
    return {metric.name: metric for metric in metrics}


def _free_running(effort: Effort, notes: list[str]) -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """Run in real time with the recorder at every rate, as normal processes and under SCHED_FIFO where permitted.

    The rate's own entry is the best that is permitted; ``<rate>_normal`` is without privilege.
    """
    kinds = {"normal": ProcessOptions()}
    if fifo_permitted():
        kinds["fifo"] = ProcessOptions(fifo=FIFO_PRIORITY)
    else:
        notes.append("SCHED_FIFO is not permitted: free running is at normal priority")
    found: dict[str, dict[str, float]] = {}
    memory: dict[str, float] = {}
    for rate in RATES_HZ:
        for kind, process in kinds.items():
            result = dds.free_run(rate, effort.free_s, process)
            memory = {name: max(mib, memory.get(name, 0.0)) for name, mib in result.memory_mib.items()}
            numbers = {
                "fresh": result.timing["fresh_share"],
                "lost": result.timing["missed"],
                "recorder_lost": float(result.lost),
                "real_time_factor": result.real_time_factor,
            }
            for name in ("p50", "p99", "p999", "max"):
                numbers[f"latency_{name}_ms"] = 1e3 * result.timing[f"latency_{name}_s"]
            found[f"{rate}_{kind}"] = numbers
        found[str(rate)] = found[f"{rate}_{list(kinds)[-1]}"]
    return found, memory
