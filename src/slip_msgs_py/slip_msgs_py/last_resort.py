"""A node that does not end because one of its callbacks fails, whatever arrived and wherever the bug is.

An exception that leaves a callback ends the executor's spin, and with it every message that was waiting. Here it stays
in the callback, and the node decides what it means.
"""

from __future__ import annotations

import os
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from slip_msgs_py.service_limits import ServiceLimits

LOUD_VARIABLE: Final = "SLIP_VIC_FAIL_LOUDLY"
"""Environment variable; "1" lets every unexpected exception end the process, as tests want it."""


def fails_loudly() -> bool:
    """Return whether unexpected exceptions are to end the process."""
    return os.environ.get(LOUD_VARIABLE) == "1"


class Failures:
    """Reports unexpected exceptions, once of each kind.

    Args:
        report: takes the line.
    """

    def __init__(self, report: Callable[[str], object]) -> None:
        self._report = report
        self._known: set[str] = set()

    def add(self, what: str, error: Exception) -> None:
        """Report an exception in `what`, where it is the first of its kind there."""
        kind = f"{what}: {type(error).__name__}"
        if kind not in self._known:
            self._known.add(kind)
            at = traceback.extract_tb(error.__traceback__)[-1:]
            where = f" ({Path(at[0].filename).name}:{at[0].lineno})" if at else ""
            self._report(f"failed in {kind}: {' '.join(str(error).split())}{where}")


class LastResort(ABC):
    """Mixin in front of an rclpy node: its callbacks, also those that rclpy makes for itself, hand failures over.

    Calls of its parameter services and transitions have limits (`service_limits`).
    """

    def __init__(self, *rest: Any, **options: Any) -> None:
        self._limits = ServiceLimits(lambda line: self.get_logger().warning(line))  # type: ignore[attr-defined]
        super().__init__(*rest, **options)
        for service in self.services:  # type: ignore[attr-defined]
            self._limits.guard(service)

    @abstractmethod
    def on_failure(self, what: str, error: Exception) -> None:
        """Decide what an exception in a callback of `what` means; must not raise."""

    def fail(self, what: str, error: Exception) -> None:
        """Hand an exception over that is just being handled; where failures are loud, raise it."""
        if fails_loudly():
            raise error
        self.on_failure(what, error)

    def create_subscription(
        self, msg_type: type, topic: str, callback: Callable[[Any], object], *rest: Any, **options: Any
    ) -> Subscription:
        """Create a subscription as rclpy does."""

        def take(message: object) -> None:
            try:
                callback(message)
            except Exception as error:
                self.fail(f"topic {topic}", error)

        return super().create_subscription(msg_type, topic, take, *rest, **options)  # type: ignore[misc]

    def create_timer(self, period_s: float, callback: Callable[[], None], *rest: Any, **options: Any) -> Timer:
        """Create a timer as rclpy does."""

        def tick() -> None:
            if timer not in self.timers:  # type: ignore[attr-defined]
                return  # it was due already when it was destroyed, and what it looks at may be gone
            try:
                callback()
            except Exception as error:
                self.fail("a timer", error)

        timer = super().create_timer(period_s, tick, *rest, **options)  # type: ignore[misc]
        return timer

    def create_service(
        self, srv_type: type, name: str, callback: Callable[[Any, Any], object], *rest: Any, **options: Any
    ) -> Service:
        """Create a service as rclpy does; a failed call is answered with the response as it was then."""
        return super().create_service(srv_type, name, self.answering(name, callback), *rest, **options)  # type: ignore[misc]

    def answering(self, name: str, callback: Callable[[Any, Any], object]) -> Callable[[object, object], object]:
        """Return a service's callback that always answers."""

        def answer(request: object, response: object) -> object:
            try:
                return callback(request, response)
            except Exception as error:
                self.fail(f"service {name}", error)
                return response

        return answer
