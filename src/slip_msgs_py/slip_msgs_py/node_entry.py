"""The first lines of a node's process: its help, and an end at once while its modules are imported."""

from __future__ import annotations

import importlib
import os
import sys

from slip_msgs_py.environment import is_of_ros, no_ros
from slip_msgs_py.stop_flag import StopFlag, ending_at_once

HELP = """usage: {name} [--ros-args [--params-file FILE] [-p NAME:=VALUE]... [-r FROM:=TO]...]

{about}

  --params-file FILE   parameters of the node; `slip-vic params` writes the files of a scenario
  -p NAME:=VALUE       one parameter; docs/parameters.md has all of them
  -r FROM:=TO          rename a topic or, with __ns:=/NAME, move the node into a namespace
"""


def main_of(module: str, node: str, name: str, about: str) -> int:
    """Run the node class `node` of a module as this process, and end it; return 0 where only help was wanted.

    Args:
        module: imported only where the node is to run.
        node: name of the class.
        name: of the executable, for the help.
        about: what the node does, for the help.
    """
    arguments = sys.argv[1 : sys.argv.index("--ros-args")] if "--ros-args" in sys.argv else sys.argv[1:]
    if {"-h", "--help"} & set(arguments):
        print(HELP.format(name=name, about=about), end="")
        return 0
    StopFlag().install()
    try:
        with ending_at_once(0):
            run_node = importlib.import_module("slip_msgs_py.node_main").run_node
            factory = getattr(importlib.import_module(module), node)
    except ModuleNotFoundError as error:
        if not is_of_ros(error):
            raise
        print(f"error: {no_ros()}", file=sys.stderr)
        return no_ros().exit_code
    code: int = run_node(factory)
    # All is closed: taking down the interpreter with its libraries takes a second on a busy machine, and does nothing.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
