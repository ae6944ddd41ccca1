"""The process of the simulation: signals are taken before the imports, which need a second."""

from __future__ import annotations

import sys

from slip_msgs_py.stop_flag import StopFlag


def main() -> int:
    """Entry point of ``slip_sim_bridge_node``."""
    StopFlag().install()
    from slip_msgs_py.node_main import run_node
    from slip_sim_bridge.node import SlipSimBridge

    return run_node(SlipSimBridge)


if __name__ == "__main__":
    sys.exit(main())
