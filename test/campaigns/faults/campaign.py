"""Many trials, in worker processes: counts, the bound that follows from them, and what a violation leaves behind."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import pandas as pd
from scipy.stats import binomtest

from slip_vic.experiments.engines import Died, PoolEngine
from test.campaigns.faults.plan import Verdict, make_plan


def summary(verdicts: Sequence[Verdict]) -> dict[str, Any]:
    """Return what faults.json holds.

    recovery: of trials with this fault alone, from its end until the law works; bound_95: the share of failing trials
    that is exceeded with 5 % confidence only.
    """
    frame = pd.DataFrame(sorted(verdicts), columns=list(Verdict._fields)).astype({"recovery_s": float})
    frame["failed"] = frame["violations"].map(bool)
    modes: Counter[str] = sum(map(Counter, frame["modes"]), Counter())
    alone = frame[frame["faults"].map(len) == 1].explode("faults").groupby("faults")["recovery_s"]
    counts = {"trials": ("trial", "size"), "violations": ("failed", "sum")}
    by_fault = frame.explode("faults").groupby("faults").agg(**counts, recovered=("recovery_s", "count"))
    by_fault = by_fault.assign(recovery_median_s=alone.median(), recovery_max_s=alone.max())
    by_setting = frame.groupby("setting").agg(**counts)
    return {
        "trials": len(frame),
        "violations": int(frame["failed"].sum()),
        "bound_95": float(binomtest(int(frame["failed"].sum()), len(frame)).proportion_ci(0.9).high),
        "commands": int(frame["commands"].sum()),
        "modes": dict(modes),
        "objects_lost": int(frame["objects_lost"].sum()),
        "by_fault": json.loads(by_fault.to_json(orient="index")),
        "by_setting": json.loads(by_setting.to_json(orient="index")),
        "failed": [verdict._asdict() for verdict in sorted(verdicts) if verdict.violations],
    }


def run_campaign(
    trials: Iterable[int], seed: int, interface: str, workers: int, native: Path | None = None
) -> Iterator[Verdict]:
    """Run trials in spawned workers; the results do not depend on their number or order. native: as for `judge`."""
    judge_one = partial(judge, interface=interface, native=native)
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


def judge(seed: int, trial: int, interface: str = "", native: Path | None = None) -> Verdict:
    """Run one trial; native: a built export whose session runs beside Python's."""
    from test.campaigns.faults.beside import BesideNative
    from test.campaigns.faults.trial import run_trial

    return run_trial(make_plan(seed, trial, interface), partial(BesideNative, native=native) if native else None)


def write_results(out: Path, verdicts: Sequence[Verdict]) -> Path:
    """Write faults.json; return its path."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "faults.json").write_text(json.dumps(summary(verdicts), indent=1) + "\n", encoding="utf-8")
    return out / "faults.json"
