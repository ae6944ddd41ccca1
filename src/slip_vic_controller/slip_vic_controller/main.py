"""The process of the controller: signals are taken before the imports, which need a second."""

from __future__ import annotations

import sys

from slip_msgs_py.stop_flag import StopFlag


def main() -> int:
    """Entry point of ``slip_vic_controller_node``."""
    StopFlag().install()
    from slip_msgs_py.node_main import run_node
    from slip_vic_controller.node import SlipVicController

    return run_node(SlipVicController)


if __name__ == "__main__":
    sys.exit(main())
