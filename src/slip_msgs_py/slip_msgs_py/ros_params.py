"""ROS parameters declared from a parameter model: types, ranges, descriptions, validation as a whole."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from typing import TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from slip_core.arms import model_of_arms
from slip_core.errors import InputError
from slip_core.params import ParameterInfo, ParameterModel, build, flatten, parameter_infos

Model = TypeVar("Model", bound=ParameterModel)
NO_SIM_TIME = "use_sim_time: this node goes by steady time and by the stamps of what it receives"
OWN_TIME = (Parameter("use_sim_time", value=False),)
"""For the constructor of a node: one that uses no ROS clock need not subscribe to `/clock`, which any node may set."""
NO_TEXTS = [""]
"""An empty list in a ROS parameter file, whose parser refuses `[]`."""
ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides.")


def declare_arms(node: Node, model: type[ParameterModel]) -> ParameterModel:
    """Declare the parameters of all arms on `node`: `arms` names them, and none is one arm.

    The node must have been made with ``automatically_declare_parameters_from_overrides=True``: that is how names that
    the model does not know are seen at all.

    Returns:
        The values given by file or command line; `slip_core.arms.by_arm` has them by arm.

    Raises:
        InputError: unknown name (nearest offered), wrong type, out of range; as in `model_of_arms`.
    """
    if node.has_parameter("arms"):
        arms = _plain(node.get_parameter("arms").value)
        if not isinstance(arms, list):
            raise InputError("parameter arms", got=arms, expected="a list of names")
        if arms:
            model = model_of_arms(model, tuple(map(str, arms)))
        else:
            node.undeclare_parameter("arms")
    names = [n for n in node.list_parameters([], 0).names if not n.startswith(ROS_OWN)]
    given = {name: _plain(node.get_parameter(name).value) for name in names}
    values = build(model, given, node.get_name())
    for name in names:
        node.undeclare_parameter(name)
    flat = flatten(values)
    for info in parameter_infos(model):
        node.declare_parameter(info.name, flat[info.name], descriptor(info), ignore_override=True)
    return values


def descriptor(info: ParameterInfo) -> ParameterDescriptor:
    """Return the ROS description of one parameter, with its range."""
    text = f"{info.description} [{info.unit}]" if info.unit else info.description
    result = ParameterDescriptor(name=info.name, description=text, read_only=not info.runtime)
    # ROS takes an empty list for one of bytes, and would refuse every list of numbers later.
    result.dynamic_typing = info.runtime and info.default == ()
    bounds = info.bounds
    high = bounds.get("le", bounds.get("lt"))
    if info.kind is float:
        result.floating_point_range = [FloatingPointRange(from_value=float(bounds["ge"]), to_value=float(high))]
    elif info.kind is int:
        most = 2**62 if high is None else high
        result.integer_range = [IntegerRange(from_value=bounds["ge"], to_value=most, step=1)]
    if "one_of" in bounds:
        result.additional_constraints = f"one of {', '.join(map(str, bounds['one_of']))}"
    return result


def _plain(value: object) -> object:
    plain = value.tolist() if isinstance(value, array) else value
    return [] if plain == NO_TEXTS else plain


def allow_changes(node: Node, current: Model, apply: Callable[[Model], None]) -> None:
    """Let run-time parameters change: checked as a whole, handed to `apply`, refused with the reason where it raises.

    What ROS calls read-only never gets here. Where anything is refused, all values of the request stay as they were.
    """
    state = {"values": current}

    def on_set(parameters: list[Parameter]) -> SetParametersResult:
        if any(p.name == "use_sim_time" and p.value is not False for p in parameters):
            return SetParametersResult(successful=False, reason=NO_SIM_TIME)
        if not all(p.name for p in parameters):  # rclpy takes this one for declared
            return SetParametersResult(successful=False, reason="a parameter without a name")
        now = flatten(state["values"])
        flat = now | {p.name: _plain(p.value) for p in parameters if p.name in now}
        if flat == now:
            return SetParametersResult(successful=True)
        try:
            wanted = build(type(current), flat, node.get_name())
            apply(wanted)
        except InputError as error:
            return SetParametersResult(successful=False, reason=str(error))
        state["values"] = wanted
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(on_set)
