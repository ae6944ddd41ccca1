"""Running callbacks: as long as somebody wants, or one after the other, with nothing left behind in memory."""

from __future__ import annotations

import time
from typing import Any

import pytest
from rclpy.experimental import EventsExecutor
from std_srvs.srv import Trigger

from slip_msgs_py.executor import Spinner


@pytest.fixture
def spinner(ros_node: Any) -> Spinner:
    executor = EventsExecutor(context=ros_node.context)
    executor.add_node(ros_node)
    return Spinner(executor)


def test_a_turn_is_one_callback(ros_node: Any, spinner: Spinner) -> None:
    called: list[float] = []
    ros_node.create_timer(0.01, lambda: called.append(time.monotonic()))
    for count in (1, 2, 3):
        while len(called) < count:
            spinner.turn(1.0)
        assert len(called) == count


def test_a_call_of_a_service_that_is_removed_while_it_is_answered_ends_nothing(ros_node: Any, spinner: Spinner) -> None:
    """As cleanup does it at the moment of a call: rclpy cannot send the response any more."""
    answered: list[int] = []

    def answer(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        answered.append(1)
        ros_node.destroy_service(service)
        return response

    service = ros_node.create_service(Trigger, "gone", answer)
    client = ros_node.create_client(Trigger, "gone")
    assert client.wait_for_service(5.0)
    client.call_async(Trigger.Request())
    end = time.monotonic() + 10.0
    while not answered and time.monotonic() < end:
        spinner.spin(0.1)
    assert answered
    called: list[int] = []
    ros_node.create_timer(0.002, lambda: called.append(1))
    spinner.spin_while(ros_node, lambda: len(called) < 5, 0.005)
    assert len(called) >= 5


def test_spins_while_condition_holds(ros_node: Any, spinner: Spinner) -> None:
    called: list[int] = []
    timers = len(list(ros_node.timers))
    ros_node.create_timer(0.002, lambda: called.append(1))
    spinner.spin_while(ros_node, lambda: len(called) < 50, 0.005)
    assert len(called) >= 50
    assert len(list(ros_node.timers)) == timers + 1
    asked: list[int] = []
    spinner.spin_while(ros_node, lambda: bool(asked.append(1)), 0.005)
    assert asked == [1]  # it was not even begun


def test_enough_asks_at_once(ros_node: Any, spinner: Spinner) -> None:
    over: list[int] = []

    def end() -> None:
        over.append(1)
        spinner.enough()

    ros_node.create_timer(0.01, end)
    spinner.spin_while(ros_node, lambda: not over, 1000.0)
    assert over == [1]
