"""Running callbacks: as long as somebody wants, or one after the other, with nothing left behind in memory."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from rclpy.experimental import EventsExecutor

from slip_bringup.domain import domain_id
from slip_msgs_py.spinning import Spinner

TURNS = 2000


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with domain_id() as domain:
        context = rclpy.Context()
        rclpy.init(args=[], context=context, domain_id=domain)
        node = rclpy.create_node("spun", context=context)
        try:
            yield node
        finally:
            node.destroy_node()
            rclpy.try_shutdown(context=context)


@pytest.fixture
def spinner(node: Any) -> Spinner:
    executor = EventsExecutor(context=node.context)
    executor.add_node(node)
    return Spinner(executor)


def blocks_left_by(call: Any) -> float:
    """Return how many blocks of Python's memory a call leaves behind."""
    call()
    before = sys.getallocatedblocks()
    for _ in range(TURNS):
        call()
    return (sys.getallocatedblocks() - before) / TURNS


def test_a_turn_leaves_nothing_behind(spinner: Spinner) -> None:
    assert blocks_left_by(lambda: spinner.turn(1e-5)) < 0.1


def test_the_reason_for_that_is_still_there(spinner: Spinner) -> None:
    """Waiting for a future leaks in these wheels; where it no longer does, ticks may wait for one again."""
    assert blocks_left_by(lambda: spinner.spin(1e-5)) > 0.5


def test_a_turn_is_one_callback(node: Any, spinner: Spinner) -> None:
    called: list[float] = []
    node.create_timer(0.01, lambda: called.append(time.monotonic()))
    for count in (1, 2, 3):
        while len(called) < count:
            spinner.turn(1.0)
        assert len(called) == count


def test_it_goes_on_for_as_long_as_somebody_wants(node: Any, spinner: Spinner) -> None:
    called: list[int] = []
    timers = len(list(node.timers))
    node.create_timer(0.002, lambda: called.append(1))
    spinner.spin_while(node, lambda: len(called) < 50, 0.005)
    assert len(called) >= 50
    assert len(list(node.timers)) == timers + 1
    asked: list[int] = []
    spinner.spin_while(node, lambda: bool(asked.append(1)), 0.005)
    assert asked == [1]  # it was not even begun


def test_enough_asks_at_once(node: Any, spinner: Spinner) -> None:
    over: list[int] = []

    def end() -> None:
        over.append(1)
        spinner.enough()

    node.create_timer(0.01, end)
    spinner.spin_while(node, lambda: not over, 1000.0)
    assert over == [1]
