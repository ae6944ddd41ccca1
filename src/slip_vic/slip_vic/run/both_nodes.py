"""Bridge and controller in one process, on one executor: the same nodes and topics, one wake-up less per message."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Callable, Iterator
from typing import Any

from rclpy.experimental import EventsExecutor

from slip_msgs_py.node_main import run_node
from slip_sim_bridge.node import SlipSimBridge
from slip_vic_controller.node.controller_node import SlipVicController


class BothNodes:
    """The bridge runs and spins the executor; the controller answers from its callbacks."""

    BRIDGE: type[SlipSimBridge] = SlipSimBridge

    def __init__(self) -> None:
        executor = EventsExecutor()
        self._controller = SlipVicController(executor)
        self._bridge = self.BRIDGE(executor)

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Run until the bridge is done or the process is asked to stop."""

        def stop_or_announce() -> bool:
            self._controller.announce_when_ready()
            return should_stop()

        self._bridge.run(stop_or_announce)

    @property
    def publishers(self) -> Iterator[Any]:
        """All publishers of both."""
        return itertools.chain(self._bridge.publishers, self._controller.publishers)

    def destroy_node(self) -> None:
        """Release everything."""
        self._bridge.destroy_node()
        self._controller.destroy_node()


def main() -> int:
    """Entry point."""
    return run_node(BothNodes)


if __name__ == "__main__":
    sys.exit(main())
