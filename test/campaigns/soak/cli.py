"""``./run soak``."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click
import pandas as pd
from rich.console import Console

from slip_vic.options import SCENARIO


@click.command()
@click.option("--minutes", type=click.FloatRange(0.1), default=60.0, show_default=True, help="real time")
@click.option("--rate", type=click.FloatRange(10.0, 2000.0), default=500.0, show_default=True, help="control rate [Hz]")
@SCENARIO
@click.option("-o", "--out", type=click.Path(path_type=Path), default=Path("out/soak"), show_default=True)
def soak(minutes: float, rate: float, scenario: str, out: Path) -> None:
    """Run for long in real time over DDS and sample memory, open files and threads of every process.

    Exit code 1 where something grows: the slope is the median over all pairs of samples after the warm-up.
    """
    from slip_vic.run.progress import progress
    from test.campaigns.soak.growth import Growth, grows, growth_of
    from test.campaigns.soak.run import run_soak, soak_scenario

    with progress(Console(stderr=True), unit=" s") as add_bar:
        on_time = add_bar(f"soak at {rate:g} Hz", 60.0 * minutes)
        result, series = run_soak(soak_scenario(scenario, minutes, rate), minutes, on_time)
    growth = {name: growth_of(samples) for name, samples in series.items()}
    growing = {name: words for name, found in growth.items() if (words := grows(found))}
    rows = {(name, quantity): one for name, found in growth.items() for quantity, one in found.items()}
    click.echo(
        pd.DataFrame.from_dict(rows, orient="index", columns=list(Growth._fields)).to_string(float_format="%.2f")
    )
    incidents = [str(incident) for incident in result.incidents]
    content = {
        "minutes": minutes, "rate_hz": rate, "ticks": result.ticks, "sim_time_s": result.sim_time_s,
        "messages": result.messages, "lost": result.lost, "incidents": incidents, "warnings": result.warnings,
        "growth": {name: {q: one._asdict() for q, one in found.items()} for name, found in growth.items()},
        "grows": growing, "series": series,
    }  # fmt: skip
    out.mkdir(parents=True, exist_ok=True)
    (out / "soak.json").write_text(json.dumps(content) + "\n", encoding="utf-8")
    click.echo(f"{result.ticks} ticks, {result.lost} of {result.messages} messages lost, {len(incidents)} incidents")
    for line in (*incidents, *result.warnings):
        click.echo(f"warning: {line}", err=True)
    for name, words in growing.items():
        click.echo(f"{name} grows: {', '.join(words)}")
    click.echo(f"results: {out / 'soak.json'}")
    if growing:
        sys.exit(1)
