"""``./run faults``, ``./run soak``, ``./run bench``, ``./run frozen``: campaigns and measurements, for developers."""

from __future__ import annotations

import sys

import click

from slip_bags.cli import run_command
from test.campaigns.bench.cli import bench
from test.campaigns.faults.cli import faults
from test.campaigns.frozen.cli import frozen
from test.campaigns.soak.cli import soak


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
def campaigns() -> None:
    """Faults, long runs, benchmarks and the frozen judge."""


for command in (bench, faults, frozen, soak):
    campaigns.add_command(command)


def main() -> int:
    """Run one of them."""
    return run_command(campaigns, "./run")


if __name__ == "__main__":
    sys.exit(main())
