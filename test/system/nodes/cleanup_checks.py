"""A controller that is cleaned up keeps no endpoints and survives what was on its way; run by `test_cleanup.py`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
from lifecycle_msgs.msg import State
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from slip_vic.scenarios.scenario import NODES, load, ros_parameter_file
from slip_vic_controller.node.controller_node import SlipVicController
from slip_vic_controller.node.task_topics import TaskTopics


@pytest.fixture
def controller(ros_domain: int, tmp_path: Path) -> Iterator[SlipVicController]:
    scenario = load("paper_planar", law="vic", mode="realtime")
    path = tmp_path / "controller.yaml"
    path.write_text(ros_parameter_file(scenario.controller, NODES["controller"][0]))
    arguments = ["--ros-args", "--params-file", str(path)]
    rclpy.init(args=arguments, domain_id=ros_domain, signal_handler_options=SignalHandlerOptions.NO)
    node = SlipVicController()
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def endpoints(node: Any) -> set[Any]:
    return {*node.publishers, *node.subscriptions, *node.services, *node.timers}


def clean_up(node: SlipVicController) -> None:
    assert node.trigger_deactivate() == TransitionCallbackReturn.SUCCESS
    assert node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS


def test_foreign_endpoints_stay(controller: SlipVicController) -> None:
    before = endpoints(controller)
    timer = controller.create_timer(1.0, lambda: None)
    clean_up(controller)
    assert timer in endpoints(controller)
    left = endpoints(controller) - {timer}
    assert left < before
    names = {service.srv_name.rsplit("/", 1)[-1] for service in controller.services}
    assert {"change_state", "set_parameters"} <= names
    assert not {"hold", "enable"} & names


def test_failed_transition_leaves_nothing(controller: SlipVicController, monkeypatch: pytest.MonkeyPatch) -> None:
    clean_up(controller)
    before = endpoints(controller)
    with monkeypatch.context() as changed:
        changed.setattr(TaskTopics, "__init__", None)
        assert controller.trigger_configure() == TransitionCallbackReturn.ERROR
    assert endpoints(controller) == before
    assert controller.trigger_configure() == TransitionCallbackReturn.SUCCESS


def test_it_can_be_configured_again(controller: SlipVicController) -> None:
    before = len(endpoints(controller))
    clean_up(controller)
    controller.trigger_configure()
    controller.trigger_activate()
    assert len(endpoints(controller)) == before
    assert controller._state_machine.current_state[0] == State.PRIMARY_STATE_ACTIVE
    assert any(p.msg_type is JointState for p in controller.publishers)
