"""Start, run and end of a node process: help, signals, one-line errors, exit codes; a bare node.

rclpy is imported by the functions that use it: help needs none, and a signal ends the process while it is imported.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import itertools
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from slip_core.errors import SlipVicError, printable
from slip_core.params import load_yaml
from slip_msgs_py.environment import choose_transport, is_of_ros, no_ros, wanted
from slip_msgs_py.stop_flag import SIGNALS, StopFlag, ending

if TYPE_CHECKING:
    from rclpy.node import Node

DELIVERY_S = 10.0  # a busy machine may starve a recorder for seconds
LAUNCHED_DELIVERY_S = 2.0  # what was lost is repeated much sooner, and a launcher that requests the end waits longer
STOP_DELIVERY_S = 0.1  # a user waits for the process to end
LONGEST_END_S = 2.5  # from the signal on; a lock of DDS may be held by a process that was killed

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
        with ending(lambda _: os._exit(0)):  # nothing is there yet that must be closed
            factory = getattr(importlib.import_module(module), node)
    except ModuleNotFoundError as error:
        if not is_of_ros(error):
            raise
        print(f"error: {no_ros()}", file=sys.stderr)
        return no_ros().exit_code
    code = run_node(factory)
    # All is closed: taking down the interpreter with its libraries takes a second on a busy machine, and does nothing.
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def run_node(factory: Callable[[], Any]) -> int:
    """Run one node process and return its exit code: 0 on a wanted end, 2 on bad input, 1 on a failure.

    Args:
        factory: makes the node once rclpy is up; its method `run` runs until the work is done or the function that it
            is given returns true.
    """
    from slip_msgs_py.executor import wake_all

    stop = StopFlag().install()
    if stop():
        return 0  # asked for while this was imported
    over = threading.Event()

    def end_in_time(number: int) -> None:
        """End the node's wait, and the process where it has not closed in time; a launcher limits an orderly end."""
        wake_all()
        if wanted() and number == SIGNALS[0]:
            return
        if not over.wait(LONGEST_END_S):
            os.write(sys.stderr.fileno(), f"error: not closed {LONGEST_END_S:g} s after the signal; ended\n".encode())
            os._exit(128 + number)

    with ending(end_in_time):
        code = _run(factory, stop)
        over.set()
    return code


def _run(factory: Callable[[], Any], stop: StopFlag) -> int:
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.signals import SignalHandlerOptions

    choose_transport()
    node: Any = None
    try:
        for flag, file in itertools.pairwise(sys.argv):
            if flag == "--params-file":  # rcl waits for the end of a FIFO, and takes the last of two values
                load_yaml(Path(file))
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        node = factory()
        node.run(stop)
    except (KeyboardInterrupt, ExternalShutdownException, rclpy.exceptions.ROSInterruptException):
        pass  # a wanted end, the last one within a wait
    except SlipVicError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return error.exit_code
    except (rclpy._rclpy_pybind11.RCLError, rclpy._rclpy_pybind11.UnknownROSArgsError) as error:
        print(f"error: ROS refused to start: {printable(' '.join(str(error).split()))}", file=sys.stderr, flush=True)
        return 2
    finally:
        if node is not None:
            patient = wanted() and not stop.in_haste
            deliver(node, DELIVERY_S if not stop() else LAUNCHED_DELIVERY_S if patient else STOP_DELIVERY_S)
            node.destroy_node()
        else:
            gc.collect()  # a node that refused its parameters has cycles, and holds its participant
        rclpy.try_shutdown()
    return 0


def deliver(node: Node, timeout_s: float) -> None:
    """Wait until reliable subscribers have all that was published, for `timeout_s` at most.

    What a publisher has not delivered when it is destroyed is lost, and a recorder would miss the end of a run.
    """
    from rclpy._rclpy_pybind11 import RCLError
    from rclpy.duration import Duration

    end = time.monotonic() + timeout_s
    for publisher in node.publishers:
        left = max(0.0, end - time.monotonic())
        with contextlib.suppress(RCLError):
            publisher.wait_for_all_acked(Duration(seconds=left))


@contextlib.contextmanager
def ros_node(name: str, namespace: str = "/", domain: int | None = None) -> Iterator[Node]:
    """Provide a bare node for one command, in its own context; it reads no command line and handles no signals.

    domain: ROS domain id; None: ROS_DOMAIN_ID.
    """
    import rclpy.node
    from rclpy.signals import SignalHandlerOptions

    choose_transport()
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    try:
        bare = {"start_parameter_services": False, "enable_rosout": False}
        node = rclpy.node.Node(name, namespace=namespace, context=context, **bare)
        try:
            yield node
        finally:
            node.destroy_node()
    finally:
        rclpy.try_shutdown(context=context)
