"""Storms and giants on the services of the nodes: they live, refuse what is too much, and say so."""

# ruff: noqa: F811 - fixtures are found by name

from __future__ import annotations

import random
import time
from typing import Any

import pytest
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)

from slip_msgs_py.service_limits import MOST_BYTES, MOST_ITEMS, TRANSITIONS_PER_S
from test.system.nodes.test_modes import CONTROLLER_SLOW, Watcher, shared_start, shared_watcher  # noqa: F401

CALLS = 1600
CONTROLLER = "/slip_vic_controller"


def number(name: str, value: float) -> ParameterMsg:
    return ParameterMsg(name=name, value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value))


@pytest.fixture(scope="module")
def watcher(shared_watcher: Watcher) -> Watcher:
    return shared_watcher


@pytest.fixture(scope="module")
def controller(shared_start: Any, watcher: Watcher) -> Any:
    """A controller alone: what services cost does not depend on whether it gives efforts."""
    node = shared_start("controller", *CONTROLLER_SLOW)
    watcher.spin(lambda: watcher.node.count_publishers("/effort_command") > 0, "a controller that is active")
    return node


def refusals(node: Any) -> list[str]:
    return [line for line in node.lines if "calls of services refused" in line]


@pytest.mark.smoke
def test_a_storm_of_transitions_and_parameters_does_not_end_the_controller(controller: Any, watcher: Watcher) -> None:
    """Any transition, those that end the process too: once a storm is there, none of them is taken."""
    rng, node = random.Random(28), watcher.node
    change = node.create_client(ChangeState, f"{CONTROLLER}/change_state")
    set_ = node.create_client(SetParameters, f"{CONTROLLER}/set_parameters")
    get = node.create_client(GetParameters, f"{CONTROLLER}/get_parameters")
    watcher.spin(lambda: all(c.service_is_ready() for c in (change, set_, get)), "services")
    futures = []
    for k in range(CALLS // 4):
        transition = Transition(id=rng.randrange(256) if k > 20 else 3)
        futures.append(change.call_async(ChangeState.Request(transition=transition)))
        futures.append(
            change.call_async(ChangeState.Request(transition=Transition(label="shutdown" if k > 20 else "x")))
        )
        futures.append(set_.call_async(SetParameters.Request(parameters=[number("gains.k_s", rng.uniform(1.0, 9.0))])))
        futures.append(get.call_async(GetParameters.Request(names=["gains.k_s"])))
        end = time.monotonic() + 0.003
        watcher.spin(lambda end=end: time.monotonic() > end, "a pause")
    # Requests beyond the depth of the service's queue are lost: rmw answers none of them.
    end = time.monotonic() + 2.0 / TRANSITIONS_PER_S + 1.0
    watcher.spin(lambda: time.monotonic() > end, "calm")
    assert controller.exit_code is None, controller.tail()
    assert any(future.done() for future in futures)
    assert any("too many" in line for line in refusals(controller)), controller.tail()
    # Which of the storm's transitions were among those taken depends on the machine: it may have been deactivated.
    state = watcher.call(GetState, f"{CONTROLLER}/get_state", GetState.Request()).current_state.id
    if state == State.PRIMARY_STATE_ACTIVE:
        assert watcher.change(Transition.TRANSITION_DEACTIVATE)
    if state != State.PRIMARY_STATE_UNCONFIGURED:
        assert watcher.change(Transition.TRANSITION_CLEANUP)
    assert watcher.change(Transition.TRANSITION_CONFIGURE)
    answer = watcher.call(
        SetParameters, f"{CONTROLLER}/set_parameters", SetParameters.Request(parameters=[number("gains.k_s", 7.0)])
    )
    assert answer.results[0].successful, answer


def giant(name: str, **values: Any) -> list[ParameterMsg]:
    return [ParameterMsg(name=name, value=ParameterValue(**values))]


MILLION = 1_000_000
GIANTS = (
    (SetParameters, {"parameters": [number("gains.k_s", 5.0)] * 20_000}),
    (SetParametersAtomically, {"parameters": [number("gains.k_s", 5.0)] * 20_000}),
    (SetParameters, {"parameters": giant("mode", string_value="x" * 5 * MILLION)}),
    (SetParameters, {"parameters": giant("x" * 5 * MILLION)}),
    (SetParameters, {"parameters": giant("gains.stiffness", double_array_value=[1.0] * MILLION)}),
    (SetParameters, {"parameters": giant("mode", integer_array_value=[1] * MILLION)}),
    (SetParameters, {"parameters": giant("mode", byte_array_value=[b"x"] * MILLION)}),
    (SetParameters, {"parameters": giant("mode", bool_array_value=[True] * MILLION)}),
    (SetParameters, {"parameters": giant("joint_names", string_array_value=["abc"] * 100_000)}),
    (SetParameters, {"parameters": giant("joint_names", string_array_value=["x" * MILLION])}),
    (GetParameters, {"names": ["gains.k_s"] * 100_000}),
    (GetParameterTypes, {"names": ["x" * MILLION]}),
    (DescribeParameters, {"names": ["gains.k_s"] * 100_000}),
    (ListParameters, {"prefixes": ["a.b"] * 100_000}),
)
SERVICES = {
    SetParameters: "set_parameters", SetParametersAtomically: "set_parameters_atomically",
    GetParameters: "get_parameters", GetParameterTypes: "get_parameter_types",
    DescribeParameters: "describe_parameters", ListParameters: "list_parameters",
}  # fmt: skip


@pytest.mark.smoke
def test_giant_requests_are_refused_and_small_ones_answered(controller: Any, watcher: Watcher) -> None:
    for kind, fields in GIANTS:
        answer = watcher.call(kind, f"{CONTROLLER}/{SERVICES[kind]}", kind.Request(**fields))
        results = answer.results if kind is SetParameters else [getattr(answer, "result", None)]
        reasons = [result.reason for result in results if hasattr(result, "reason")]
        refused = f"refused: a request may have {MOST_ITEMS} items and {MOST_BYTES} bytes"
        assert reasons == ([refused] if kind in (SetParameters, SetParametersAtomically) else [])
    label = ChangeState.Request(transition=Transition(label="x" * 10 * MILLION))
    assert not watcher.call(ChangeState, f"{CONTROLLER}/change_state", label).success
    assert any(f"{MOST_BYTES} bytes" in line for line in refusals(controller))
    names = ["gains.k_s"] * MOST_ITEMS
    values = watcher.call(GetParameters, f"{CONTROLLER}/get_parameters", GetParameters.Request(names=names)).values
    assert len(values) == MOST_ITEMS
    listed = watcher.call(ListParameters, f"{CONTROLLER}/list_parameters", ListParameters.Request()).result.names
    assert "gains.k_s" in listed
    described = watcher.call(
        DescribeParameters, f"{CONTROLLER}/describe_parameters", DescribeParameters.Request(names=listed)
    )
    assert [each.name for each in described.descriptors] == list(listed)


def test_every_value_of_a_request_arrives(controller: Any, watcher: Watcher) -> None:
    """The layout of C messages, which the limits read, is that of today's ROS."""
    six = [100.0, 100.0, 100.0, 10.0, 10.0, 10.0]
    stiffness = giant("gains.stiffness", type=ParameterType.PARAMETER_DOUBLE_ARRAY, double_array_value=six)
    request = SetParameters.Request(parameters=[*stiffness, number("gains.k_s", 6.0), number("no.such", 1.0)])
    results = watcher.call(SetParameters, f"{CONTROLLER}/set_parameters", request).results
    assert [result.successful for result in results] == [True, True, False], results
    got = GetParameters.Request(names=["gains.stiffness", "gains.k_s"])
    values = watcher.call(GetParameters, f"{CONTROLLER}/get_parameters", got).values
    assert list(values[0].double_array_value) == six
    assert values[1].double_value == 6.0
