"""Bridge and controller of two arms in one process, as `slip_vic.run.both_nodes`."""

from __future__ import annotations

import sys

from slip_msgs_py.node_main import run_node
from slip_vic.run.both_nodes import BothNodes


class BothTeamNodes(BothNodes):
    """The nodes of two arms."""


def main() -> int:
    """Entry point."""
    return run_node(BothTeamNodes)


if __name__ == "__main__":
    sys.exit(main())
