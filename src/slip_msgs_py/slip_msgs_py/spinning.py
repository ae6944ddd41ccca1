"""Running callbacks on the EventsExecutor: for a time, or until a callback says that it is enough.

One long call instead of many `spin_once`: each call sets signal handlers and timers up anew, which costs as much as
two messages. `spin` without a timeout is not used, because it hangs in these wheels.
"""

from __future__ import annotations

from typing import Any

from rclpy.task import Future


class Spinner:
    """Runs the callbacks of an executor's nodes.

    Args:
        executor: an EventsExecutor.
    """

    def __init__(self, executor: Any) -> None:
        self._executor = executor
        self._enough = Future()

    def spin(self, timeout_s: float) -> None:
        """Run callbacks until `enough` is called from one of them, or for `timeout_s`."""
        self._enough = Future()
        self._executor.spin_until_future_complete(self._enough, timeout_sec=timeout_s)

    def enough(self) -> None:
        """End the present `spin` after this callback."""
        if not self._enough.done():
            self._enough.set_result(None)
