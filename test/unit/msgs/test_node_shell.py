"""Guarded callbacks, and what is due once a second."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from slip_msgs_py.node_shell import LOUD_VARIABLE, GuardedNode, OnceEvery

SECOND = 1_000_000_000
PHASES = (0.0, 0.25, 0.5, 0.75)


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


def failing_calls(node: Node) -> list[Callable[[], object]]:
    take, tick = node.create_subscription(None, "t", fails), node.create_timer(1.0, fails)
    answer = node.create_service(None, "s", fails)
    return [lambda: take("message"), tick, lambda: answer("request", "response")]


def test_failures_stay_in_callbacks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LOUD_VARIABLE, "0")
    node = Node()
    *_, response = [call() for call in failing_calls(node)]
    assert response == "response"
    assert node.failures == [f"{what}: ZeroDivisionError()" for what in ("topic t", "a timer", "service s")]


@pytest.mark.parametrize("kind", range(3), ids=["topic", "timer", "service"])
def test_loud_failures_are_raised(kind: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LOUD_VARIABLE, "1")
    with pytest.raises(ZeroDivisionError):
        failing_calls(Node())[kind]()


def test_destroyed_timer_does_not_run() -> None:
    node, calls = Node(), []
    tick = node.create_timer(1.0, lambda: calls.append(1))
    tick()
    node.timers.clear()
    tick()
    assert calls == [1]


def due_times(phase: float, times: range) -> list[int]:
    publishing = OnceEvery(SECOND, phase)
    return [t for t in times if publishing.due(t)]


@pytest.mark.parametrize("phase", PHASES)
def test_due_first_then_once_per_period(phase: float) -> None:
    begin = 7 * SECOND + 100_000_000
    first, *after = due_times(phase, range(begin, begin + 3 * SECOND, 1_000_000))
    assert first == begin
    assert len(after) == 3
    assert all((t - round(phase * SECOND)) % SECOND == 0 for t in after)


def test_phases_do_not_coincide() -> None:
    begin = 5_000_000
    after = [set(due_times(phase, range(begin, 4 * SECOND, 1_000_000))[1:]) for phase in PHASES]
    assert sum(map(len, after)) == len(set.union(*after))


def test_clock_set_back_starts_a_period() -> None:
    publishing = OnceEvery(SECOND, 0.0)
    assert [publishing.due(t) for t in (5 * SECOND, 5 * SECOND + 1, SECOND, SECOND)] == [True, False, True, False]
