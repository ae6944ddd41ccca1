"""The bridge node with a bug put into it: a step of the simulation fails now and then. Run as a process by a test."""

import sys

from slip_msgs_py.node_main import run_node
from slip_sim_bridge.node import SlipSimBridge
from slip_sim_bridge.simulation import Simulation

FIRST, LAST = 200, 230

good, calls = Simulation.step, [0]


def step(self: Simulation, *arguments: object) -> None:
    calls[0] += 1
    if FIRST <= calls[0] < LAST:
        raise ZeroDivisionError("put in by a test")
    good(self, *arguments)


Simulation.step = step  # type: ignore[method-assign, assignment]
if __name__ == "__main__":
    sys.exit(run_node(SlipSimBridge))
