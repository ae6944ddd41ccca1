"""The controller node with a bug put into it: Pinocchio's call fails now and then. Run as a process by a test."""

import sys

from slip_msgs_py.node_main import run_node
from slip_vic_controller.node.controller_node import SlipVicController
from slip_vic_controller.robot import Robot

FIRST, LAST = 200, 230

good, calls = Robot.terms, [0]


def terms(self: Robot, *arguments: object) -> None:
    calls[0] += 1
    if FIRST <= calls[0] < LAST:
        raise ZeroDivisionError("put in by a test")
    good(self, *arguments)


Robot.terms = terms  # type: ignore[method-assign, assignment]
if __name__ == "__main__":
    sys.exit(run_node(SlipVicController))
