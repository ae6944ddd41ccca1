"""``slip-vic report`` and ``slip-vic watch``."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import click

from slip_vic.options import out_option
from slip_vic.page import require_page


@click.command()
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
    write_page(out, runs, command=shlex.join(["slip-vic", *sys.argv[1:]]))
    click.echo(f"{out}: {out.stat().st_size / 1e6:.2f} MB")


@click.command()
@click.option("--namespace", default="", help="of the arm; default: every namespace with joint states")
@click.option("--domain-id", type=int, help="default ROS_DOMAIN_ID, else that of the newest `slip-vic run`, else 0")
@click.option("--port", type=click.IntRange(0, 65535), default=8765, show_default=True, help="0: a free one")
def watch(namespace: str, domain_id: int | None, port: int) -> None:
    """Show in the browser what runs now: the same picture and plots, from the topics.

    Without --domain-id and ROS_DOMAIN_ID it shows the newest `slip-vic run` of this machine.
    """
    require_page()
    from slip_bags.ros_node import ros_node
    from slip_msgs_py.stop_flag import StopFlag
    from slip_vic.page.audience import Audience
    from slip_vic.page.live import watch as run_watch
    from slip_vic.run.domain import chosen_domain, domains_in_use

    runs = domains_in_use()
    wanted = chosen_domain(domain_id)
    domain = (runs or [0])[0] if wanted is None else wanted
    audience = Audience(port)
    click.echo(f"http://127.0.0.1:{audience.port}/  (Ctrl-C ends)")
    try:
        here = "a run of slip-vic" if domain in runs else "joint_states and robot_description"
        click.echo(f"watching ROS domain {domain} for {here}", err=True)
        with StopFlag() as stop, ros_node("slip_vic_watch", domain=domain) as node:
            run_watch(node, audience, namespace, stop)
    finally:
        audience.close()
