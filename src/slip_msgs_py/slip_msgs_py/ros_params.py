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
"""For the constructor of a node: one that asks no ROS clock need not listen to `/clock`, which any node may set."""
NO_TEXTS = [""]
"""An empty list in a ROS parameter file, whose parser refuses `[]`."""
ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides.")


def declare(node: Node, model: type[Model]) -> Model:
    """Declare every parameter of `model` on `node` and return the values given by file or command line.

    The node must have been made with ``automatically_declare_parameters_from_overrides=True``: that is
    how names that the model does not know are seen at all.

    Raises:
        InputError: unknown name (nearest offered), wrong type, out of range.
    """
    names = [n for n in node.list_parameters([], 0).names if not n.startswith(ROS_OWN)]
    given = {name: _plain(node.get_parameter(name).value) for name in names}
    values = build(model, given, node.get_name())
    for name in names:
        node.undeclare_parameter(name)
    flat = flatten(values)
    for info in parameter_infos(model):
        node.declare_parameter(info.name, _ros_value(info, flat[info.name]), descriptor(info), ignore_override=True)
    return values


def declare_arms(node: Node, model: type[ParameterModel]) -> ParameterModel:
    """Declare the parameters of all arms on `node` as `declare` does: `arms` names them, and none is one arm.

    Returns:
        The values; `slip_core.arms.by_arm` has them by arm.

    Raises:
        InputError: as in `declare` and `model_of_arms`.
    """
    if not node.has_parameter("arms"):
        return declare(node, model)
    names = _plain(node.get_parameter("arms").value)
    if not isinstance(names, list):
        raise InputError("parameter arms", got=names, expected="a list of names")
    if not names:
        node.undeclare_parameter("arms")
        return declare(node, model)
    return declare(node, model_of_arms(model, tuple(map(str, names))))


def descriptor(info: ParameterInfo) -> ParameterDescriptor:
    """Return the ROS description of one parameter, with its range."""
    text = f"{info.description} [{info.unit}]" if info.unit else info.description
    result = ParameterDescriptor(name=info.name, description=text, read_only=not info.runtime)
    # ROS takes an empty list for one of bytes, and would refuse every list of numbers later.
    result.dynamic_typing = info.runtime and info.default == ()
    bounds = info.bounds
    low, high = bounds.get("ge", bounds.get("gt")), bounds.get("le", bounds.get("lt"))
    if info.kind is float and (low is not None or high is not None):
        result.floating_point_range = [
            FloatingPointRange(
                from_value=float(-1e308 if low is None else low), to_value=float(1e308 if high is None else high)
            )
        ]
    if info.kind is int and (low is not None or high is not None):
        result.integer_range = [
            IntegerRange(
                from_value=int(-(2**62) if low is None else low), to_value=int(2**62 if high is None else high), step=1
            )
        ]
    if "one_of" in bounds:
        result.additional_constraints = f"one of {', '.join(map(str, bounds['one_of']))}"
    return result


def _plain(value: object) -> object:
    plain = value.tolist() if isinstance(value, array) else value
    return [] if plain == NO_TEXTS else plain


def _ros_value(info: ParameterInfo, value: object) -> object:
    # An empty list has no element type in ROS: the kind of the model decides.
    if value == []:
        text = str(info.kind)
        kind = (
            Parameter.Type.DOUBLE_ARRAY if "float" in text
            else Parameter.Type.BOOL_ARRAY if "bool" in text
            else Parameter.Type.INTEGER_ARRAY if "int" in text
            else Parameter.Type.STRING_ARRAY
        )  # fmt: skip
        return Parameter(info.name, kind, []).value
    return value


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
