"""``slip-vic pair`` and ``slip-vic pair-study``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click

from slip_vic.options import ASSIGNMENTS

LAWS = ("classical", "leader_follower", "classical_internal", "printed", "shared", "internal", "governed")


def _laws(text: str) -> list[Any]:
    return [name.strip() for name in text.split(",") if name.strip()]


@click.command()
@click.option("--scenario", default="pane_two_arms_upright", show_default=True, help="name or .yaml file")
@click.option("--laws", default=",".join(LAWS), show_default=True, help="names, comma separated")
@click.option("--late", type=click.IntRange(0), default=0, help="control periods that commands are on their way")
@click.option("--out", type=click.Path(path_type=Path), help="folder for pair.png and a CSV file of every law")
@ASSIGNMENTS
def pair(scenario: str, laws: str, late: int, out: Path | None, assignments: tuple[str, ...]) -> None:
    """Two arms carry one object, in this process: slip, internal force and path error of every law."""
    from rich.console import Console

    from slip_vic.pair.measures import judge, verdicts
    from slip_vic.pair.picture import write_series
    from slip_vic.pair.scenario import load_pair

    series: dict[str, list[tuple[float, ...]]] = {}
    judged = {
        law: judge(load_pair(scenario, law=law, assignments=assignments), late, series.setdefault(law, []))
        for law in _laws(laws)
    }
    Console(width=150).print(verdicts(f"{scenario} {' '.join(assignments)}", judged))
    if out is not None:
        write_series(out, scenario, series)
        click.echo(str(out / "pair.png"))


@click.command()
@click.option("--scenarios", default="pane_two_arms_flat,pane_two_arms_upright", show_default=True)
@click.option("--laws", default="classical,internal,governed", show_default=True, help="names, comma separated")
@click.option("--draws", type=click.IntRange(1), default=300, show_default=True, help="worlds, over all scenarios")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--jobs", type=click.IntRange(1), default=None, help="parallel processes; default one per core")
@click.option("--out", type=click.Path(path_type=Path), default=Path("pair_study"), show_default=True, help="folder")
@ASSIGNMENTS
def pair_study(
    scenarios: str, laws: str, draws: int, seed: int, jobs: int | None, out: Path, assignments: tuple[str, ...]
) -> None:
    """Two arms in random worlds that their controllers do not know: panes lost, slip; pair_study.csv."""
    from rich.console import Console

    from slip_vic.pair.scenario import load_pair
    from slip_vic.pair.study import run_draws, summary, write_results

    for scenario in _laws(scenarios):
        for law in _laws(laws):
            load_pair(scenario, law=law, assignments=assignments)
    out.mkdir(parents=True, exist_ok=True)
    results = list(run_draws(draws, seed, _laws(scenarios), _laws(laws), jobs or os.cpu_count() or 1, assignments))
    write_results(out / "pair_study.csv", results)
    Console(width=150).print(summary(results))
    click.echo(str(out / "pair_study.csv"))
