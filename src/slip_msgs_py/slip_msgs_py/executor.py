"""Running callbacks on the EventsExecutor: until a condition, for a time, or one.

One long call instead of many `spin_once`: each call sets signal handlers and timers up again, which costs as much as
two messages. `spin` without a timeout is not used, because it hangs in these wheels; and every call that waits for a
future leaves 32 bytes behind in them, so that is not what is done in every tick.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from weakref import WeakSet

from rclpy._rclpy_pybind11 import InvalidHandle
from rclpy.clock import Clock, ClockType
from rclpy.experimental import EventsExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.task import Future

_LONG_S = 10.0
_spinners: WeakSet[Spinner] = WeakSet()


def wake_all() -> None:
    """End the present `spin` of every spinner after the callback that runs; from any thread.

    Callbacks run in the order in which they became due: behind a thousand calls of a service a timer is late.
    """
    for spinner in tuple(_spinners):
        spinner.enough()


class Spinner:
    """Runs the callbacks of an executor's nodes.

    Args:
        executor: an EventsExecutor.
    """

    def __init__(self, executor: EventsExecutor) -> None:
        self._executor = executor
        self._enough = Future()
        _spinners.add(self)

    def spin_while(self, node: Node, goes_on: Callable[[], bool], every_s: float) -> None:
        """Run callbacks while `goes_on` is true, which is checked at this period and after `enough`."""

        def look() -> None:
            if not goes_on():
                self.enough()

        timer = node.create_timer(every_s, look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        try:
            while goes_on():
                self.spin(_LONG_S)
        finally:
            node.destroy_timer(timer)

    def spin(self, timeout_s: float) -> None:
        """Run callbacks until `enough` is called from one of them, or for `timeout_s`."""
        self._enough = Future()
        self._run(self._executor.spin_until_future_complete, self._enough, timeout_sec=timeout_s)

    def turn(self, timeout_s: float) -> None:
        """Run the next callback, if there is one within `timeout_s`; for what is done in every tick."""
        self._run(self._executor.spin_once, timeout_sec=timeout_s)

    @staticmethod
    def _run(call: Callable[..., object], *arguments: object, **options: object) -> None:
        """Let the executor run; without a message that it cannot take or answer it continues.

        There is no memory for it, or what it was for has been destroyed while it was handled, by a transition.
        """
        try:
            call(*arguments, **options)
        except (MemoryError, InvalidHandle) as error:
            with suppress(MemoryError):
                why = "no memory is left" if isinstance(error, MemoryError) else "what it was for has just been removed"
                get_logger(__name__).error(f"a message was dropped: {why}", throttle_duration_sec=1.0)

    def enough(self) -> None:
        """End the present `spin` after this callback."""
        if not self._enough.done():
            self._enough.set_result(None)
