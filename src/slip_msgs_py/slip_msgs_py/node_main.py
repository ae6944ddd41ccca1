"""Start, run and end of a node process: signals, one-line errors, exit codes, events for the launcher."""

from __future__ import annotations

import contextlib
import gc
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import rclpy
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException
from rclpy.signals import SignalHandlerOptions

from slip_core.errors import SlipVicError
from slip_msgs_py.environment import choose_transport
from slip_msgs_py.events import wanted
from slip_msgs_py.executor import wake_all
from slip_msgs_py.stop_flag import SIGNALS, StopFlag, ending


class RunnableNode(Protocol):
    """What `run_node` needs: a node that runs until it is stopped."""

    def run(self, should_stop: Callable[[], bool]) -> None:
        """Run until the work is done or `should_stop` says so."""

    @property
    def publishers(self) -> Iterator[Any]:
        """All publishers."""

    def destroy_node(self) -> None:
        """Release everything."""


DELIVERY_S = 10.0  # a busy machine may starve a recorder for seconds
LAUNCHED_DELIVERY_S = 2.0  # what was lost is repeated much sooner, and a launcher that requests the end waits longer
STOP_DELIVERY_S = 0.1  # a user waits for the process to end
LONGEST_END_S = 2.5  # from the signal on; a lock of DDS may be held by a process that was killed


def run_node(factory: Callable[[], RunnableNode]) -> int:
    """Run one node process and return its exit code: 0 on a wanted end, 2 on bad input, 1 on a failure.

    Args:
        factory: makes the node once rclpy is up.
    """
    stop = StopFlag().install()
    if stop():
        return 0  # asked for while this was imported
    over = threading.Event()
    with ending(lambda number: _end_in_time(number, over)):
        code = _run(factory, stop)
        over.set()
    return code


def _end_in_time(number: int, over: threading.Event) -> None:
    """End the node's wait, and the process where it has not closed in time; an orderly end a launcher limits itself."""
    wake_all()
    if wanted() and number == SIGNALS[0]:
        return
    if not over.wait(LONGEST_END_S):
        os.write(sys.stderr.fileno(), f"error: not closed {LONGEST_END_S:g} s after the signal; ended\n".encode())
        os._exit(128 + number)


def _run(factory: Callable[[], RunnableNode], stop: StopFlag) -> int:
    choose_transport()
    node: RunnableNode | None = None
    try:
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
        node = factory()
        node.run(stop)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass  # a wanted end
    except SlipVicError as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return error.exit_code
    except rclpy.exceptions.ROSInterruptException:
        pass  # a wanted end too, within a wait
    except (rclpy._rclpy_pybind11.RCLError, rclpy._rclpy_pybind11.UnknownROSArgsError) as error:
        print(f"error: ROS refused to start: {' '.join(str(error).split())}", file=sys.stderr, flush=True)
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


def deliver(node: RunnableNode, timeout_s: float) -> None:
    """Wait until reliable subscribers have all that was published, for `timeout_s` at most.

    What a publisher has not delivered when it is destroyed is lost, and a recorder would miss the end of a run.
    """
    end = time.monotonic() + timeout_s
    for publisher in node.publishers:
        left = max(0.0, end - time.monotonic())
        with contextlib.suppress(rclpy._rclpy_pybind11.RCLError):
            publisher.wait_for_all_acked(Duration(seconds=left))
