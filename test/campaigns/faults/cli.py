"""``./run faults``."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
import pandas as pd
from rich.console import Console

from slip_core.errors import InputError
from slip_vic.run.progress import progress

SHOWN_VIOLATIONS = 5


@click.command()
@click.option("--trials", type=click.IntRange(1), default=100, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True)
@click.option("--first", type=click.IntRange(0), default=0, show_default=True, help="number of the first trial")
@click.option(
    "--interface",
    type=click.Choice(["effort", "velocity", "position"]),
    default=None,
    help="command interface of the arm; default drawn by the seed",
)
@click.option("--attacks", "attacking", is_flag=True, help="attack node processes over DDS instead")
@click.option("--only", multiple=True, metavar="NAME", help="only attacks whose name contains this; repeatable")
@click.option(
    "--native",
    type=click.Path(path_type=Path),
    help="a built slip-vic export: attack its node, or compare its session with Python's in every trial, bit by bit",
)
@click.option("--workers", type=click.IntRange(1), help="worker processes; default one per core")
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("out/faults"), show_default=True)
def faults(
    *,
    trials: int,
    seed: int,
    first: int,
    interface: str | None,
    attacking: bool,
    only: tuple[str, ...],
    native: Path | None,
    workers: int | None,
    out: Path,
) -> None:
    """Seeded fault campaign: is every effort finite, inside its limits, and does the arm come to a safe state?

    Exit code 1 where a trial shows otherwise; the command that repeats it is printed. Violations are printed as they
    are found; Ctrl-C ends with the summary so far.
    """
    from test.campaigns.faults import beside, campaign

    if attacking:
        _attack(only, out, native)
        return
    if native is not None:
        beside.compile_more(native)
    console, verdicts, failed = Console(stderr=True), list[campaign.Verdict](), list[campaign.Verdict]()

    try:
        with progress(console) as add_bar:
            report = add_bar("fault trials", trials)
            processes = workers or min(trials, os.cpu_count() or 1)
            chosen = range(first, first + trials)
            for verdict in campaign.run_campaign(chosen, seed, interface or "", processes, native):
                verdicts.append(verdict)
                if verdict.violations:
                    failed.append(verdict)
                    console.print(verdict.text(), markup=False, highlight=False, soft_wrap=True)
                report(len(verdicts), f"{len(failed)} with violations")
    finally:
        if verdicts:
            path = campaign.write_results(out, verdicts)
            _report(campaign.summary(verdicts))
            click.echo(f"results: {path}")
    for verdict in failed[:SHOWN_VIOLATIONS]:
        flag = (f" --interface {interface}" if interface else "") + (f" --native {native}" if native else "")
        click.echo(f"{verdict.text()}\n  again: ./run faults{flag} --seed {seed} --first {verdict.trial} --trials 1")
    if failed:
        sys.exit(1)


def _attack(only: tuple[str, ...], out: Path, native: Path | None) -> None:
    from test.campaigns.attacks.attacks import ATTACKS
    from test.campaigns.attacks.suite import Row, run_attacks

    names = [name for name in ATTACKS if not only or any(words in name for words in only)]
    if not names:
        raise InputError("--only", got=", ".join(only), expected=f"a part of one of: {', '.join(ATTACKS)}")
    table = dict[str, tuple[str, str, str]]()

    def on_done(row: Row) -> None:
        back = "never" if row.recovery_s is None else f"{row.recovery_s:.2f}{', helped' if row.helped else ''}"
        promise = (
            "process ended" if not row.alive else f"{len(row.violations)} violations" if row.violations else "kept"
        )
        table[row.attack] = promise, row.worst_mode, back
        more = f"{row.lines_per_s:.1f} log lines/s, memory {row.grown_mib:+.1f} MiB{', ' if row.note else ''}{row.note}"
        click.echo(f"{row.attack}: {'kept' if row.kept else 'NOT KEPT'}; {more}", err=True)
        for text in row.violations[:SHOWN_VIOLATIONS]:
            click.echo(f"  {text}", err=True)

    try:
        rows = run_attacks(names, out, on_done, native)
    finally:
        if table:
            columns = ["promise", "worst mode", "law again [s]"]
            click.echo(pd.DataFrame.from_dict(table, orient="index", columns=columns).to_string())
            click.echo(f"results: {out / 'attacks.json'}")
    if not all(row.kept for row in rows):
        sys.exit(1)


def _report(summary: Mapping[str, Any]) -> None:
    click.echo(pd.DataFrame.from_dict(summary["by_fault"], orient="index").to_string(float_format="%.2f", na_rep="-"))
    click.echo(
        f"{summary['trials']} trials, {summary['commands']} commands, {summary['violations']} trials with violations; "
        f"95 % bound on the share of bad trials: {100.0 * summary['bound_95']:.3g} %"
    )
