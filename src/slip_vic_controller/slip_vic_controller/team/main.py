"""The process of the controller of two arms: signals are taken before the imports, which need a second."""

from __future__ import annotations

import sys

from slip_msgs_py.stop_flag import StopFlag


def main() -> int:
    """Entry point of ``slip_vic_controller_two_arms_node``."""
    StopFlag().install()
    from slip_msgs_py.node_main import run_node
    from slip_vic_controller.team.node import TeamController

    return run_node(TeamController)


if __name__ == "__main__":
    sys.exit(main())
