"""The process of the controller."""

from __future__ import annotations

import sys

from slip_msgs_py.node_main import main_of

ABOUT = """The controller: joint states, wrench and slip velocity in, joint efforts out.
A managed (lifecycle) node: it configures and activates itself unless auto_activate is false.
It waits until the bridge or a robot's drivers publish its inputs."""


def main() -> int:
    """Entry point of ``slip_vic_controller_node``."""
    return main_of("slip_vic_controller.node.controller_node", "SlipVicController", "slip_vic_controller_node", ABOUT)


if __name__ == "__main__":
    sys.exit(main())
