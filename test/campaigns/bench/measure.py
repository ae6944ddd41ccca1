"""The whole bench: rounds of everything side by side, then free running; the numbers as data."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import pandas as pd

from slip_msgs_py.environment import choose_transport
from slip_vic.scenarios.scenario import load
from test.campaigns.bench import cost, dds
from test.campaigns.bench.machine import calibration_s, fifo_permitted, machine
from test.campaigns.faults.beside import compile_more

FIFO_PRIORITY = 80
RATES_HZ = (500, 1000, 2000)
LATENCIES = ("p50", "p99", "p999", "max")
Say = Callable[[str], None]


class Effort(NamedTuple):
    """How long to measure: rounds, lockstep time, ticks and turns of each, and seconds of each free run."""

    rounds: int = 5
    lockstep_s: float = 1.5
    loop_ticks: int = 1500
    turns: int = 600
    free_s: float = 10.0


QUICK = Effort(rounds=2, lockstep_s=0.3, loop_ticks=200, turns=60, free_s=1.0)


class Metric(NamedTuple):
    """A quantity of each round: `over`, as it was measured, or over another one, times `scale`."""

    name: str
    over: str
    under: str = ""
    unit: str = ""
    note: str = ""
    scale: float = 1.0


_BARE, _GOVERNED = "pinocchio terms", "control step, governed"
METRICS: Final = (
    Metric("control_step_ratio", "control step", _BARE, note="control step / Pinocchio terms it needs"),
    Metric("control_step_observer_ratio", "control step, observer", _BARE, note="the same with slip observer"),
    Metric("control_step_governed_ratio", _GOVERNED, _BARE, note="the same with reference governor"),
    Metric("estimator_ratio", "control step, estimator", _GOVERNED, note="with / without joint state estimator"),
    Metric("velocity_ratio", "control step, velocity", _GOVERNED, note="commands of velocities / efforts"),
    Metric("supervised_loop_real_time_factor", "supervised loop", "", "x", "simulator, sensors, whole cycle"),
    Metric("recorder_ratio", "lockstep, recorded", "lockstep", note="lockstep tick with / without recorder"),
    Metric("pinocchio_terms_us", _BARE, unit="us", scale=1e6),
    Metric("control_step_us", "control step", unit="us", scale=1e6),
    Metric("control_step_governed_us", _GOVERNED, unit="us", scale=1e6),
    Metric("lockstep_tick_us", "lockstep", unit="us", scale=1e6),
)


class BenchResult(NamedTuple):
    """Metrics and free runs by name, the machine, and how much equal work varied between rounds.

    metrics: median, min and max over the rounds.
    """

    metrics: pd.DataFrame
    free_running: pd.DataFrame
    starts: pd.DataFrame
    machine: dict[str, Any]
    noise: float


def run_bench(effort: Effort, say: Say, native: Path | None = None) -> BenchResult:
    """Measure everything; `say` gets each stage; native: a built export, measured in turn with the Python node."""
    found, rounds = machine(), _rounds(effort, say)
    say("free running")
    choose_transport()  # also for the floor, which does not choose
    controllers: dict[str, Path | None] = {"python": None}
    floor = {}
    if native is not None:
        compile_more(native)
        controllers["native"], floor["floor"] = native, native / "floor"
    free = _free_running(effort, controllers | floor)
    say("start and memory")
    starts = pd.DataFrame([{"of": of, **dds.start(at)} for _ in range(effort.rounds) for of, at in controllers.items()])
    speed = rounds["calibration"]
    noise = float((speed.max() - speed.min()) / speed.median())
    return BenchResult(over_rounds(rounds), free, starts.groupby("of").median(), found, noise)


def over_rounds(rounds: pd.DataFrame) -> pd.DataFrame:
    """Return median, min and max of each metric; ratios are formed within a round: what slows both does not show."""
    values = {m.name: m.scale * rounds[m.over] / (rounds[m.under] if m.under else 1.0) for m in METRICS}
    return pd.DataFrame(values).agg(["median", "min", "max"]).T


def _rounds(effort: Effort, say: Say) -> pd.DataFrame:
    vic = load(cost.SCENARIO, law="vic")
    scenario = load(cost.SCENARIO, law="vic", set=(f"bridge.duration_s={effort.lockstep_s}",))
    step = cost.stretch(vic)
    pieces: dict[str, cost.Call | cost.Stretch] = {
        "control step": step,
        _BARE: cost.bare_terms(step.session.controller.first.robot, step.inputs[0].joint),
        "control step, observer": cost.stretch(cost.observer_scenario()),
        _GOVERNED: cost.stretch(cost.governed_scenario()),
        "control step, estimator": cost.stretch(cost.governed_scenario("torque_joint")),
        "control step, velocity": cost.stretch(cost.governed_scenario("velocity_500")),
    }
    measures: Mapping[str, Callable[[], float]] = {
        "lockstep": lambda: dds.lockstep_tick_s(scenario),
        "lockstep, recorded": lambda: dds.lockstep_tick_s(scenario, record=True),
        "supervised loop": lambda: cost.supervised_loop_factor(vic, effort.loop_ticks),
    }
    rows = []
    for number in range(effort.rounds):
        say(f"round {number + 1} of {effort.rounds}")
        row = {"calibration": calibration_s(), **cost.interleaved(pieces, effort.turns)}
        rows.append(row | {name: measures[name]() for name in random.Random(number).sample([*measures], 3)})
    return pd.DataFrame(rows)


def _free_running(effort: Effort, controllers: Mapping[str, Path | None]) -> pd.DataFrame:
    """Run in real time with the recorder at every rate, as normal processes and under SCHED_FIFO where permitted."""
    kinds = {"normal": None} | ({"fifo": FIFO_PRIORITY} if fifo_permitted() else {})
    rows = {}
    for rate in RATES_HZ:
        for kind, fifo in kinds.items():
            for of, folder in controllers.items():
                result = dds.free_run(rate, effort.free_s, fifo, folder)
                more = {"recorder_lost": float(result.lost), "real_time_factor": result.real_time_factor}
                rows[f"{rate}_{kind}_{of}"] = _timing(result.timing) | {"missed": result.timing["missed"]} | more
            if floor := controllers.get("floor"):
                rows[f"{rate}_{kind}_wake-ups"] = _timing(dds.wake_ups(rate, effort.free_s, fifo, floor))
    return pd.DataFrame.from_dict(rows, orient="index")


def _timing(of: Mapping[str, float]) -> dict[str, float]:
    return {"fresh": of["fresh_share"], **{f"latency_{key}_ms": 1e3 * of[f"latency_{key}_s"] for key in LATENCIES}}
