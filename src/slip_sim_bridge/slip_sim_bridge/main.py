"""The process of the simulation."""

from __future__ import annotations

import sys

from slip_msgs_py.node_main import main_of

ABOUT = """The simulation: one arm or several that hold an object, with their sensors, on ROS topics.
It waits until the controller is ready."""


def main() -> int:
    """Entry point of ``slip_sim_bridge_node``."""
    return main_of("slip_sim_bridge.node", "SlipSimBridge", "slip_sim_bridge_node", ABOUT)


if __name__ == "__main__":
    sys.exit(main())
