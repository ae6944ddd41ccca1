"""Print the table of docs/drives.md: slip and distance from the goal of laws on drives, in every scenario of one arm.

python tools/drive_table.py --drive torque_joint --law governed --sensor all     # a row per scenario and sensor
python tools/drive_table.py --drive velocity_500 --scenario ur5e/paper_planar.yaml   # an arm of `slip-vic arm`
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import click

import slip_vic
from slip_core.errors import SlipVicError
from slip_vic.presets import preset_names
from slip_vic.run.metrics import off_goal_m
from slip_vic.scenarios import scenario_names
from slip_vic.study.lottery import SETTLES_S


def rows(
    drives: list[str], scenarios: list[str], laws: list[str], sensors: list[str], seeds: range, changes: Sequence[str]
) -> Iterator[str]:
    """Yield the rows of the table."""
    for drive in drives:
        for name in scenarios:
            for sensor in sensors:
                for law in laws:
                    for seed in seeds:
                        cells = result(name, law, drive, sensor, seed, changes)
                        yield f"| {drive} | {name} | {sensor} | {law} | {seed} | {cells} |"


def result(name: str, law: str, drive: str, sensor: str, seed: int, changes: Sequence[str] = ()) -> str:
    """Return slip, distance from the goal and outcome of a run, as cells."""
    planned = next(iter(slip_vic.load(name).controllers.values())).trajectory
    short = f"bridge.duration_s={planned.start_s + planned.duration_s + SETTLES_S}"
    try:
        world = slip_vic.load(name, law=law, drive=drive, sensor=sensor, seed=seed, set=[short, *changes])  # type: ignore[arg-type]
        run = world.run()
    except SlipVicError as error:
        return f"refused: {error} | |"
    pairs = zip(run.track.series(), run.scenario.controllers.values(), strict=True)
    off_mm = 1e3 * max(off_goal_m(series, params) for series, params in pairs)
    return f"{run.slip_mm:.2f} | {off_mm:.1f} | {run.outcome}{': ' if run.reason else ''}{run.reason}"


@click.command()
@click.option("--drive", "drives", default="ideal,torque_joint,motor_current", show_default=True)
@click.option("--scenario", "scenarios", default=",".join(scenario_names(1)), help="names or .yaml files")
@click.option("--law", "laws", default="classical,vic,governed", show_default=True)
@click.option("--sensor", "sensors", default="all", show_default=True)
@click.option("--seeds", default=1, show_default=True, help="how many")
@click.option("--first", default=0, show_default=True, help="the first seed")
@click.option("--set", "changes", multiple=True, metavar="KEY=VALUE", help="override a parameter; repeatable")
def main(
    drives: str, scenarios: str, laws: str, sensors: str, seeds: int, first: int, changes: tuple[str, ...]
) -> None:
    """Run all and print a row each."""
    click.echo("| drive | scenario | sensor | law | seed | slip, mm | off the goal, mm | outcome |")
    click.echo("|---|---|---|---|---|---|---|---|")
    chosen = list(preset_names("sensors")) if sensors == "all" else sensors.split(",")
    of = range(first, first + seeds)
    for row in rows(drives.split(","), scenarios.split(","), laws.split(","), chosen, of, changes):
        click.echo(row)


if __name__ == "__main__":
    main()
