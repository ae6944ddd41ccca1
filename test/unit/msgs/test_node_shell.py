"""Guarded callbacks."""

from __future__ import annotations

from typing import Any

from slip_msgs_py.node_shell import GuardedNode


class Rclpy:
    """Stands for rclpy's node: hands back the callbacks."""

    def create_subscription(self, _type: Any, _topic: str, callback: Any, *_rest: Any, **_options: Any) -> Any:
        return callback

    def create_timer(self, _period: float, callback: Any, *_rest: Any, **_options: Any) -> Any:
        self.timers = [callback]
        return callback

    def create_service(self, _type: Any, _name: str, callback: Any, *_rest: Any, **_options: Any) -> Any:
        return callback


class Node(GuardedNode, Rclpy):
    def __init__(self) -> None:
        self.failures: list[str] = []

    def on_failure(self, what: str, error: Exception) -> None:
        self.failures.append(f"{what}: {error!r}")


def fails(*_arguments: Any) -> None:
    raise ZeroDivisionError


def test_failures_stay_in_callbacks() -> None:
    node = Node()
    take, tick = node.create_subscription(None, "t", fails), node.create_timer(1.0, fails)
    answer = node.create_service(None, "s", fails)
    take("message")
    tick()
    assert answer("request", "response") == "response"
    assert node.failures == [f"{what}: ZeroDivisionError()" for what in ("topic t", "a timer", "service s")]


def test_destroyed_timer_does_not_run() -> None:
    node, calls = Node(), []
    tick = node.create_timer(1.0, lambda: calls.append(1))
    tick()
    node.timers.clear()
    tick()
    assert calls == [1]
