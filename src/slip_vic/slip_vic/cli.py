"""The ``slip-vic`` command line."""

from __future__ import annotations

import math
import os
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from slip_bags.cli import bag, echo, run_command
from slip_core.errors import InputError
from slip_core.files.resources import bounded_memory
from slip_core.topics import checked_namespace
from slip_vic import __version__
from slip_vic.experiments.cli import benchmark, check, study, tune
from slip_vic.options import DOMAIN_ID, SCENARIOS, Choice, choosing, end_with, out_option
from slip_vic.page import require_page
from slip_vic.setup.cli import arm, bringup, identify
from slip_vic.setup.export import export

if TYPE_CHECKING:
    from slip_vic.run.launcher import RunResult
    from slip_vic.run.run import Run

LONGEST_JUDGED_S = 60.0
"""Longest run of which a bag is made only to judge it."""


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
@click.version_option(__version__, prog_name="slip-vic")
def cli() -> None:
    """Variable impedance control for slippery grasps on ROS 2: run, record, compare."""


@cli.command()
@choosing("scenario", "law", "mode", "seed", "sensor", "drive", "gripper", "parameters", "set")
@click.option("--record", type=click.Path(path_type=Path), help="record a bag into this new folder")
@click.option("--namespace", callback=checked_namespace, default="", help="ROS namespace of all nodes")
@DOMAIN_ID
@click.option("--fifo", type=click.IntRange(1, 99), help="SCHED_FIFO priority of bridge and controller")
@click.option("--native", type=click.Path(path_type=Path), help="folder of `slip-vic export` whose node controls")
@click.option("--in-process", is_flag=True, help="run both nodes in this process, without DDS or ROS")
@click.option("--page", type=click.Path(path_type=Path), help="write the page of the run")
def run(
    *, choice: Choice, record: Path | None, namespace: str, domain_id: int | None, fifo: int | None,
    native: Path | None, in_process: bool, page: Path | None,
) -> None:  # fmt: skip
    """Run one scenario: bridge, controller and recorder as processes on DDS; --in-process needs no ROS.

    Ends with slip, goal error, arrival and changes of mode, except after more than a minute without --record.

    Exit code 1 after a FAULT, or if the object was lost, the path could not be followed or the arm saturated.
    """
    if page is not None:
        require_page()
    from slip_vic.run.prepare import prepare
    from slip_vic.scenarios.scenario import load

    loaded = load(**choice)
    prepare()  # before anything is imported that compiles

    from rich.console import Console

    console, done = Console(stderr=True), None
    if in_process:
        if choice["mode"] == "realtime" or record is not None:
            given = "--record" if record is not None else "--mode realtime"
            raise InputError("--in-process", got=given, expected="lockstep without DDS: there is nothing to record")
        loaded.check()
        with console.status(f"{loaded.name} {loaded.law}"):
            done = loaded.run()
        bad = [] if done.outcome == "ok" else [done.reason]
    else:
        judged = record is not None or loaded.duration_s <= LONGEST_JUDGED_S
        if page is not None and not judged:
            got = f"no --record, and {loaded.duration_s:g} s"
            raise InputError("--page", got=got, expected="a bag to draw", fix="--record BAG")
        from slip_vic.run.judge import judge_bag
        from slip_vic.run.launcher import Launcher
        from slip_vic.run.progress import progress

        with tempfile.TemporaryDirectory(prefix="slip_vic_run_") as folder:
            launcher = Launcher(
                loaded, bag=record or (Path(folder) / "bag" if judged else None),
                wanted_domain=domain_id, namespace=namespace, fifo=fifo, native=native,
            )  # fmt: skip
            with progress(console, unit=" s") as add_bar:
                result = launcher.run(
                    add_bar(f"{loaded.name} {loaded.law}", loaded.duration_s),
                    lambda domain: echo(f"ROS domain {domain}; slip-vic watch shows the run"),
                )
            done = None if result.bag is None else judge_bag(result.bag, loaded, result.incidents)
        bad = [str(incident) for incident in result.incidents]
        for line in result_lines(result):
            echo(line)
        for line in result.warnings:
            echo(f"warning: {line}", err=True)
        if record is not None:
            echo(f"bag: {record} ({result.messages} messages, {result.lost} lost)")
    if done is not None:
        for line in summary_lines(done):
            echo(line)
        if page is not None:
            echo(f"page: {done.page(page)}")
        elif record is not None:
            echo(f"page: {shlex.join(['slip-vic', 'report', str(record), '-o', 'report.html'])}")
    end_with(bad)


def result_lines(result: RunResult) -> Iterator[str]:
    """Yield the last lines of a run over DDS: its time, and where it could not be judged."""
    yield (
        f"{result.ticks} ticks, {result.sim_time_s:.3f} s simulated in {result.wall_time_s:.2f} s "
        f"({result.real_time_factor:.2f} x real time)"
    )
    if timing := result.timing:
        yield (
            f"fresh ticks {100.0 * timing['fresh_share']:.2f} %, overruns {timing['overruns']:.0f}, "
            f"missed {timing.get('missed', 0.0):.0f}; state to command "
            f"{1e3 * timing['latency_p50_s']:.2f} ms (p99 {1e3 * timing['latency_p99_s']:.2f}, "
            f"max {1e3 * timing['latency_max_s']:.2f})"
        )
    if result.bag is None:
        yield "slip, error and arrival: with --record BAG, or --in-process"


def summary_lines(run: Run) -> Iterator[str]:
    """Yield the summary of a run: a line for each arm, and one for each change of its mode."""
    for name in run.summary:
        arm, changes = f"{name}: " if name else "", run.modes[name]
        yield f"{arm}{run.sentence(name)}"
        if [text for _, text in changes] not in ([], ["ACTIVE"]):
            yield from (f"{arm}from {at:.2f} s {text}" for at, text in changes)
    if not math.isnan(run.internal_force_n):
        yield f"internal force at most {run.internal_force_n:.2f} N"


@cli.command()
@choosing("scenario", "seed", "sensor", "drive", "gripper", "parameters", "set")
@out_option("out", "output folder")
@DOMAIN_ID
def demo(*, choice: Choice, out: Path, domain_id: int | None) -> None:
    """Compare classical, variable and governed impedance on one scenario: table, report.html, summary.json, bags."""
    from slip_msgs_py.environment import check_ros

    require_page()
    check_ros()
    from slip_vic.run.prepare import prepare
    from slip_vic.scenarios.scenario import load

    load(**choice)  # a typo ends here
    prepare()

    from rich.console import Console

    from slip_vic.run.demo import run_demo

    summary = run_demo(choice, out, Console(stderr=True), domain_id)
    lines = (f"{kind}: {incident}" for kind, run in summary["runs"].items() for incident in run["incidents"])
    end_with(lines)


@cli.command()
@SCENARIOS
@out_option("config", "folder")
@click.option("--reference", is_flag=True, help="write docs/parameters.md and docs/topics.md instead, below --out")
def params(scenarios: tuple[str, ...], out: Path, reference: bool) -> None:
    """Write the ROS parameter files of the scenarios, for nodes that are started individually."""
    from slip_vic.scenarios.parameter_files import config_files, parameter_page, topic_page, write_files

    pages = {"parameters.md": parameter_page(), "topics.md": topic_page()} if reference else {}
    files = pages or config_files(list(scenarios))
    write_files(out, files)
    for name in files:
        echo(out / name)


@cli.command()
@click.argument("bags", metavar="BAG [BAG...]", nargs=-1, required=True, type=click.Path(path_type=Path))
@out_option("report.html", "the page")
def report(bags: tuple[Path, ...], out: Path) -> None:
    """Write one self-contained web page of recorded runs: 3D replay, linked plots, table."""
    require_page()
    from slip_vic.page.page import write_page
    from slip_vic.run.data import read_data

    labels = [path.name if path.is_dir() else path.stem for path in bags]
    if len(set(labels)) != len(labels):
        labels = [str(path) for path in bags]
    runs = {label: read_data(path) for label, path in zip(labels, bags, strict=True)}
    bounded_memory(f"page of {', '.join(labels)}")(write_page)(
        out, runs, command=shlex.join(["slip-vic", *sys.argv[1:]])
    )
    echo(f"{out}: {out.stat().st_size / 1e6:.2f} MB")


@cli.command()
@click.option(
    "--namespace", callback=checked_namespace, default="", help="namespace of the arm; default: all with joint states"
)
@DOMAIN_ID
@click.option("--port", type=click.IntRange(0, 65535), default=8765, show_default=True, help="0: a free one")
def watch(namespace: str, domain_id: int | None, port: int) -> None:
    """Show the current run live in the browser, with the picture and plots of a report.

    Without --domain-id and ROS_DOMAIN_ID it shows the newest `slip-vic run` on this machine.
    """
    require_page()
    from slip_msgs_py.node_main import ros_node
    from slip_msgs_py.stop_flag import StopFlag
    from slip_vic.page.audience import Audience
    from slip_vic.page.live import watch as run_watch
    from slip_vic.run.domain import domains_in_use

    runs = domains_in_use()
    domain = (runs or [0])[0] if domain_id is None else domain_id
    audience = Audience(port)
    echo(f"http://127.0.0.1:{audience.port}/  (Ctrl-C ends)")
    try:
        here = "a run of slip-vic" if domain in runs else "joint_states and robot_description"
        with StopFlag() as stop, ros_node("slip_vic_watch", domain=domain) as node:
            echo(f"watching ROS domain {domain} for {here}", err=True)
            run_watch(node, audience, namespace, stop)
    finally:
        audience.close()


@bag.command()
@click.argument("bag_path", metavar="BAG", type=click.Path(path_type=Path))
def verify(bag_path: Path) -> None:
    """Run the controller again on the recorded inputs and compare every effort bit by bit.

    Exit code 0: identical. 1: not, with the first difference. 2: this bag cannot be verified.
    """
    from rich.console import Console

    from slip_bags.reader import Bag
    from slip_vic.replay.run_data import read_run
    from slip_vic.replay.verify import other_software, verify_run
    from slip_vic.run.data import software_of

    opened = Bag(bag_path)
    with bounded_memory(f"bag {bag_path}"):
        runs, software = read_run(opened), software_of(opened)
    with Console(stderr=True).status("replaying"):
        verdict = verify_run(runs)
    echo(verdict.text())
    if not verdict.identical:
        for note in other_software(software):
            echo(f"note: {note}")
        raise click.exceptions.Exit(1)


@cli.command()
@click.argument("path", type=click.Path(path_type=Path))
@choosing("scenario", "parameters", "set")
@out_option("out/retime", "folder")
def retime(*, path: Path, choice: Choice, out: Path) -> None:
    """Compute a timing of a path that the grasp's friction admits, for any controller.

    PATH is a CSV file with one column per joint [rad] or the pad's pose: x, y, z [m], qx, qy, qz, qw. With a column
    `time` [s] no stretch between rests takes less time than given; without it, or with times too short for friction,
    the motion is as fast as friction admits. Arm, object, grip and friction are those of the scenario. The output is a
    smooth path through the points with its new timing, and a certificate: load, and largest distance from the straight
    lines between the points. A pose given twice is a wait and is kept.
    """
    from slip_vic.retime.command import run_retime

    for line in run_retime(path, choice, out):
        echo(line)


for _command in (arm, bag, benchmark, bringup, check, export, identify, study, tune):
    cli.add_command(_command)


def main() -> int:
    """Run the command line ``slip-vic``; return its exit code."""
    return run_command(cli, "slip-vic")


def process() -> None:
    """Run the command line as this process, and end it.

    What starts nodes ends without taking down the interpreter: with its libraries that takes seconds on a busy machine.
    """
    if sys.argv[1:2] not in (["run"], ["demo"]):
        sys.exit(main())
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


if __name__ == "__main__":
    process()
