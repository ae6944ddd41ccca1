"""Recorded runs of a real robot: make the table, calibrate the grasp, predict a run, judge by leaving runs out.

python tools/real_runs.py table RAW_DIR [OUT]   the committed table, from the data set's folders
python tools/real_runs.py fit                   the calibrated grasp, from the table
python tools/real_runs.py cross                 every run predicted from the others
python tools/real_runs.py predict RUN_DIR       JSON, from RUN_DIR/robot_state.csv and nothing else of it
python tools/real_runs.py detect                slip detectors learnt from the other runs, against the marker
python tools/real_runs.py limit                 friction learnt from the first slip, and the timing below it

The results are rows of docs/evidence/real-data.csv.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

sys.path.insert(0, str(Path(__file__).parents[1]))

from slip_core.errors import SlipVicError
from tools.real_data.calibrate import CALIBRATION
from tools.real_data.table import TABLE


@click.group()
def main() -> None:
    """Recorded runs of a real robot."""


@main.command()
@click.argument("raw", type=click.Path(path_type=Path))
@click.argument("out", type=click.Path(path_type=Path), default=TABLE)
def table(raw: Path, out: Path) -> None:
    """Write the small table of all runs below a folder of the data set."""
    from tools.real_data.table import make_table

    click.echo(f"{out}: {make_table(raw, out)} runs")


@main.command()
@click.option("--members", default=40, show_default=True, help="of the ensemble")
@click.option("--processes", default=2, show_default=True)
@click.option("--out", "-o", type=click.Path(path_type=Path), default=CALIBRATION, show_default=True)
def fit(members: int, processes: int, out: Path) -> None:
    """Calibrate the grasp on all runs of the table, after cross --refit; some minutes."""
    from tools.real_data import calibrate, cross
    from tools.real_data.table import read_table

    runs, (_, deviation) = read_table(), cross.ensembles()
    found = calibrate.fit(runs, members, seed=0, processes=processes)
    calibrate.write(out, runs, found, deviation)
    click.echo(f"{out}: {len(found)} members, cost {found[0].cost:.1f} to {found[-1].cost:.1f}")


@main.command()
@click.argument("run", type=click.Path(path_type=Path))
def predict(run: Path) -> None:
    """Predict a run from the motion of its pads alone and print JSON."""
    from tools.real_data import calibrate
    from tools.real_data.predict import predict
    from tools.real_data.runs import read_pad_motion

    prediction = predict(read_pad_motion(run), calibrate.read()[0])
    click.echo(json.dumps(prediction.json()))


@main.command()
@click.option("--refit", is_flag=True, help="fit the ensembles again first; a quarter of an hour")
@click.option("--members", default=40, show_default=True, help="of each ensemble")
@click.option("--processes", default=2, show_default=True)
@click.option("--seed", default=0, show_default=True, help="of starts and draws")
def cross(refit: bool, members: int, processes: int, seed: int) -> None:
    """Predict every run from the others."""
    from tools.real_data import cross

    if refit:
        cross.leave_one_out(members, processes, seed)
    click.echo("\n".join(cross.table()))


@main.command()
def detect() -> None:
    """Score slip detectors, learnt from the other runs, against the marker."""
    from tools.real_data import detect

    click.echo("\n".join(detect.table()))


@main.command()
def limit() -> None:
    """Learn friction from the first slip, and time the path of the run that lost the object below it."""
    from tools.real_data import limit

    click.echo("\n".join(limit.table(limit.timings())))


if __name__ == "__main__":
    try:
        main.main(standalone_mode=False)
    except SlipVicError as error:
        click.echo(f"real_runs: {error}", err=True)
        sys.exit(error.exit_code)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
