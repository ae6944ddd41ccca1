"""Many trials, in worker processes: counts, the bound that follows from them, and what a violation leaves behind."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

from slip_vic.experiments.engines import Died
from slip_vic.experiments.engines.pool import PoolEngine
from test.campaigns.faults.plan import Plan, all_faults, make_plan, with_arm_and_task

WRITTEN_EVERY_S = 60.0


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the campaign keeps of a trial."""

    trial: int
    faults: tuple[str, ...]
    violations: tuple[str, ...]
    recovery_s: float | None
    commands: int
    modes: dict[str, int]
    objects_lost: int = 0
    setting: str = ""

    def text(self) -> str:
        """Return the number of the trial, its faults and its first violation."""
        return f"trial {self.trial} ({', '.join(self.faults)}): {self.violations[0]}"


@dataclass
class Tally:
    """Results so far."""

    seed: int
    two_arms: bool = False
    interface: str = ""
    verdicts: list[Verdict] = field(default_factory=list)

    @property
    def failed(self) -> list[Verdict]:
        """Trials with a violation."""
        return [verdict for verdict in self.verdicts if verdict.violations]

    def summary(self) -> dict[str, Any]:
        """Return what faults.json holds."""
        trials, failed = len(self.verdicts), self.failed
        names = sorted({name for verdict in self.verdicts for name in verdict.faults})
        return {
            "trials": trials,
            "violations": len(failed),
            "bound_95": upper_bound_95(trials, len(failed)),
            "seed": self.seed,
            "two_arms": self.two_arms,
            "interface": self.interface or "drawn",
            "commands": sum(verdict.commands for verdict in self.verdicts),
            "modes": _added(verdict.modes for verdict in self.verdicts),
            "objects_lost": sum(verdict.objects_lost for verdict in self.verdicts),
            "by_fault": {name: _by_fault([v for v in self.verdicts if name in v.faults]) for name in names},
            "by_setting": {
                name: {"trials": len(found), "violations": sum(bool(v.violations) for v in found)}
                for name in sorted({verdict.setting for verdict in self.verdicts})
                if (found := [verdict for verdict in self.verdicts if verdict.setting == name])
            },
            "failed": [asdict(verdict) for verdict in failed],
        }


def _by_fault(verdicts: Sequence[Verdict]) -> dict[str, Any]:
    alone = sorted(v.recovery_s for v in verdicts if len(v.faults) == 1 and v.recovery_s is not None)
    return {
        "trials": len(verdicts),
        "violations": sum(bool(v.violations) for v in verdicts),
        "recovered": sum(v.recovery_s is not None for v in verdicts),
        # Of trials with this fault alone: time from its end until the law is at work.
        "recovery_median_s": alone[len(alone) // 2] if alone else None,
        "recovery_max_s": alone[-1] if alone else None,
    }


def _added(counts: Iterable[dict[str, int]]) -> dict[str, int]:
    total: dict[str, int] = {}
    for each in counts:
        for name, count in each.items():
            total[name] = total.get(name, 0) + count
    return total


def upper_bound_95(trials: int, failures: int) -> float:
    """Return the share of failing trials that is exceeded with 5 % confidence only (Clopper and Pearson)."""
    from scipy.special import betaincinv  # takes a third of a second to import

    return 1.0 if failures >= trials else float(betaincinv(failures + 1, trials - failures, 0.95))


def run_in_process(
    tally: Tally, trials: Iterable[int], workers: int, out: Path, on_done: Callable[[Verdict], None]
) -> None:
    """Run trials in spawned workers, into a tally; the results do not depend on their number or order.

    faults.json in `out` is written now and then: a campaign that is killed has left what it found.
    """
    judge_one = partial(judge_pair if tally.two_arms else judge, interface=tally.interface)
    written_s = time.monotonic()
    try:
        for verdict in _verdicts(tally.seed, trials, workers, judge_one):
            tally.verdicts.append(verdict)
            on_done(verdict)
            if verdict.violations or time.monotonic() > written_s + WRITTEN_EVERY_S:
                write_results(out, tally)
                written_s = time.monotonic()
    finally:
        tally.verdicts.sort(key=lambda verdict: verdict.trial)


def _verdicts(
    seed: int, trials: Iterable[int], workers: int, judge_one: Callable[[int, int], Verdict]
) -> Iterator[Verdict]:
    if workers == 1:
        yield from (judge_one(seed, trial) for trial in trials)
        return
    with PoolEngine(workers) as engine:
        for trial, verdict in engine.run(partial(_quietly, judge_one), seed, trials):
            if isinstance(verdict, Died):
                raise RuntimeError(f"trial {trial}: {verdict.reason}")
            yield verdict


def _quietly(judge_one: Callable[[int, int], Verdict], seed: int, trial: int) -> Verdict:
    """Judge on a worker; what the middleware's decoder prints about every damaged message is dropped."""
    _no_stderr()
    return judge_one(seed, trial)


@cache
def _no_stderr() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)


def plan_of(seed: int, trial: int, interface: str = "") -> Plan:
    """Return the plan of an in-process trial; interface: what the arm takes, empty = drawn."""
    from test.campaigns.faults.trial import LATEST_START_S, LONGEST_S

    plan = make_plan(seed, trial, all_faults(), LATEST_START_S, LONGEST_S, interface)
    return with_arm_and_task(plan, LATEST_START_S, LONGEST_S)


def judge(seed: int, trial: int, interface: str = "") -> Verdict:
    """Run one trial in process."""
    from test.campaigns.faults.trial import run_trial

    outcome = run_trial(plan_of(seed, trial, interface))
    return Verdict(
        trial,
        tuple(fault.name for fault in outcome.plan.faults),
        tuple(outcome.violations),
        outcome.recovery_s,
        outcome.commands,
        dict(outcome.modes),
        outcome.objects_lost,
        outcome.plan.setting,
    )


def judge_pair(seed: int, trial: int, interface: str = "") -> Verdict:
    """Run one trial with two arms in process."""
    from test.campaigns.faults.pair import PairTrial, make_plan

    scenario, planned, taken = make_plan(seed, trial, interface)
    run = PairTrial(scenario, planned, seed, trial, taken)
    violations = tuple(run.run())
    commands = sum(monitor.commands for monitor in run.commands)
    return Verdict(
        trial,
        tuple(fault.name for fault in planned),
        violations,
        None,
        commands,
        dict(run.modes),
        setting=f"{scenario} {taken}",
    )


def write_results(out: Path, tally: Tally) -> Path:
    """Write faults.json; return its path."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / "faults.json"
    temporary = path.with_suffix(".tmp")
    temporary.write_text(json.dumps(tally.summary(), indent=1) + "\n", encoding="utf-8")
    os.replace(temporary, path)
    return path
