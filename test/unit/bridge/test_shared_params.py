"""Arm, object, contacts and sensors are declared once for both nodes: what one accepts the other does not refuse."""

from __future__ import annotations

from slip_core.grasp_params import ArmParams, ContactParams, ObjectParams
from slip_core.params import ParameterModel, parameter_infos
from slip_sim_bridge.params import BridgeParams
from slip_vic_controller.params.controller_params import ControllerParams

NODES = (BridgeParams, ControllerParams)
SAME_NAME_OTHER_MEANING = {"mode", "expected_subscribers"}  # what a node does in it, whom it waits for


def declared(model: type[ParameterModel]) -> dict[str, tuple]:
    return {
        info.name: (info.kind, info.default, info.unit, info.description, dict(info.bounds))
        for info in parameter_infos(model)
    }


def test_parameters_of_one_name_have_one_declaration():
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
