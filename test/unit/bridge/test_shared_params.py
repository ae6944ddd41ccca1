"""Arm, object, contacts and sensors are declared once for both nodes: what one accepts the other does not refuse."""

from __future__ import annotations

import pytest

from slip_core.errors import InputError
from slip_core.grasp_params import QUATERNION_TOLERANCE, ArmParams, ContactParams, ObjectParams
from slip_core.params import ParameterModel, build, parameter_infos
from slip_sim_bridge.params import BridgeParams
from slip_vic_controller.params.node_params import ControllerNodeParams

NODES = (BridgeParams, ControllerNodeParams)
SAME_NAME_OTHER_MEANING = {"mode", "expected_subscribers"}  # what a node does in it, whom it waits for


def declared(model: type[ParameterModel]) -> dict[str, tuple]:
    return {
        info.name: (info.kind, info.default, info.unit, info.description, dict(info.bounds))
        for info in parameter_infos(model)
    }


def accepts(model: type[ParameterModel], values: dict) -> bool:
    try:
        build(model, values, "test")
    except InputError:
        return False
    return True


def quaternion(norm: float) -> tuple[float, ...]:
    return (0.0, 0.6 * norm, 0.0, 0.8 * norm)


@pytest.mark.parametrize(
    "norm", [1.0, 1.0004, 1.0008, 0.9992, 1.0 + QUATERNION_TOLERANCE * 0.999, 1.0011, 0.9989, 0.0, 2.0]
)
def test_both_nodes_take_the_same_quaternions(norm):
    """|q| = 1.0008 once passed the controller, which tests |q|, and was refused by the bridge, which tested |q|^2."""
    expected = abs(norm - 1.0) <= QUATERNION_TOLERANCE
    assert [accepts(model, {"contacts.orientation_xyzw": quaternion(norm)}) for model in NODES] == [expected] * 2


def test_parameters_of_one_name_have_one_declaration():
    """slip_axes once had two defaults."""
    bridge, controller = (declared(model) for model in NODES)
    common = (bridge.keys() & controller.keys()) - SAME_NAME_OTHER_MEANING
    shared = {"object.mass", "contacts.slip_axes", "contacts.orientation_xyzw", "gravity", "ee_frame", "joint_names"}
    assert shared <= common
    for name in common - {"control_period_s"}:
        assert bridge[name] == controller[name], name
    assert bridge["control_period_s"][1] == controller["control_period_s"][1]


def test_each_node_takes_changes_only_of_what_it_can_change():
    at_runtime = [{info.name for info in parameter_infos(model) if info.runtime} for model in NODES]
    assert not [name for name in at_runtime[0] if name.startswith(("object.", "contacts."))]
    assert {"object.mass", "object.inertia", "contacts.position"} <= at_runtime[1]
    assert "contacts.orientation_xyzw" not in at_runtime[1]
    for model in (ArmParams, ObjectParams, ContactParams):
        assert not any(info.runtime for info in parameter_infos(model))
