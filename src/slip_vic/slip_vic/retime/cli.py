"""``slip-vic retime``."""

from __future__ import annotations

from pathlib import Path

import click

from slip_vic.options import ASSIGNMENTS, PARAMS, SCENARIO, URDF, out_option


@click.command()
@click.argument("path", type=click.Path(path_type=Path))
@SCENARIO
@click.option(
    "--timing", type=click.Choice(["slow_down", "time_optimal"]), default="slow_down", show_default=True,
    help="never faster than the path as given, or as fast as friction admits",
)  # fmt: skip
@click.option("--topic", default="", help="of the trajectory in a bag with several")
@PARAMS
@ASSIGNMENTS
@URDF
@out_option("out/retime", "folder")
def retime(
    path: Path, scenario: str, timing: str, topic: str, params: Path | None, assignments: tuple[str, ...],
    urdf: Path | None, out: Path,
) -> None:  # fmt: skip
    """Give a path the timing that the grasp's friction admits, for any controller to follow.

    PATH is a CSV file or a bag with a trajectory_msgs/JointTrajectory. A CSV file has a column `time` [s] and either
    one column per joint [rad] or the pad's pose: x, y, z [m], qx, qy, qz, qw. Arm, object, grip and friction are those
    of the scenario. The result is the same path with a new timing, and a certificate: the load at every sample.
    """
    from slip_vic.retime.command import run_retime
    from slip_vic.scenarios.scenario import read_parameters, urdf_assignment

    given = (*urdf_assignment(urdf), *assignments)
    for line in run_retime(path, scenario, timing, topic, read_parameters(params), given, out):
        click.echo(line)
