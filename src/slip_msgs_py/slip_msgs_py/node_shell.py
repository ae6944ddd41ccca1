"""What every node of the suite adds to rclpy's: callbacks that never end the process, topics per arm, steady ticks.

An exception that leaves a callback ends the executor's spin, and the messages that were waiting are lost with it. Here
it stays in the callback, and the node decides what it means.
"""

from __future__ import annotations

import ctypes
import gc
import resource
import sys
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.timer import Timer

_PR_SET_TIMERSLACK: Final = 29
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_SWITCH_INTERVAL_S: Final = 1e-4  # a busy Python thread otherwise keeps the interpreter for 5 ms


class GuardedNode(ABC):
    """Mixin in front of an rclpy node: exceptions in its callbacks are handed to `on_failure`."""

    _reported: frozenset[str] = frozenset()

    def report_failure(self, what: str, error: Exception) -> None:
        """Log an exception in `what`, where it is the first of its kind there."""
        kind = f"{what}: {type(error).__name__}"
        if kind not in self._reported:
            self._reported |= {kind}
            at = traceback.extract_tb(error.__traceback__)[-1:]
            where = f" ({Path(at[0].filename).name}:{at[0].lineno})" if at else ""
            line = f"failed in {kind}: {' '.join(str(error).split())}{where}"
            self.get_logger().error(line)  # type: ignore[attr-defined]

    @abstractmethod
    def on_failure(self, what: str, error: Exception) -> None:
        """Decide what an exception in a callback of `what` means; must not raise."""

    def create_subscription(
        self, msg_type: type, topic: str, callback: Callable[[Any], object], *rest: Any, **options: Any
    ) -> Subscription:
        """Create a subscription as rclpy does."""
        guarded = self.guarded(f"topic {topic}", callback)
        return super().create_subscription(msg_type, topic, guarded, *rest, **options)  # type: ignore[misc]

    def create_timer(self, period_s: float, callback: Callable[[], None], *rest: Any, **options: Any) -> Timer:
        """Create a timer as rclpy does; one that was due already when it was destroyed does not run."""

        def tick() -> None:
            if timer in self.timers:  # type: ignore[attr-defined]
                callback()

        timer = super().create_timer(period_s, self.guarded("a timer", tick), *rest, **options)  # type: ignore[misc]
        return timer

    def create_service(
        self, srv_type: type, name: str, callback: Callable[[Any, Any], object], *rest: Any, **options: Any
    ) -> Service:
        """Create a service as rclpy does; a failed call is answered with the response as it was then."""
        return super().create_service(srv_type, name, self.guarded(f"service {name}", callback), *rest, **options)  # type: ignore[misc]

    def guarded(self, what: str, callback: Callable[..., object]) -> Callable[..., object]:
        """Return a callback that hands its failures over; one that fails returns its last argument, the response."""

        def call(*arguments: object) -> object:
            try:
                return callback(*arguments)
            except Exception as error:
                self.on_failure(what, error)
                return arguments[-1] if arguments else None

        return call


class NodePart:
    """One arm's part of a node that has several: its relative topics lie below a prefix; otherwise it is the node.

    Args:
        node: the node.
        prefix: of relative names, e.g. ``left/``; empty changes nothing.
    """

    def __init__(self, node: Node, prefix: str) -> None:
        self._node, self._prefix = node, prefix

    def __getattr__(self, name: str) -> Any:
        return getattr(self._node, name)

    def _below(self, topic: str) -> str:
        return topic if topic.startswith(("/", "~")) else self._prefix + topic

    def create_publisher(self, msg_type: type, topic: str, *rest: Any, **options: Any) -> Publisher:
        """Create a publisher as the node does."""
        return self._node.create_publisher(msg_type, self._below(topic), *rest, **options)

    def create_subscription(self, msg_type: type, topic: str, *rest: Any, **options: Any) -> Subscription:
        """Create a subscription as the node does."""
        return self._node.create_subscription(msg_type, self._below(topic), *rest, **options)

    def get_fully_qualified_name(self) -> str:
        """Return the node's name followed by that of the arm."""
        arm = self._prefix.rstrip("/")
        return f"{self._node.get_fully_qualified_name()}/{arm}".rstrip("/")


def set_up_process() -> None:
    """Sharpen this thread's timers, shorten other threads' turns, and take all objects made so far out of gc's sight.

    A full collection takes 14 ms with these libraries loaded. Memory is locked where its limit is unlimited: with any
    other limit a later allocation would fail.
    """
    libc = ctypes.CDLL(None)
    libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()
    if resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY:
        libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT)
