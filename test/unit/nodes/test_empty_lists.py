"""An empty list on its way through a ROS parameter file: rcl's parser refuses `[]`."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import yaml

from slip_msgs_py.ros_params import declare
from slip_sim_bridge.params import BridgeParams
from slip_vic.scenarios.scenario import load_scenario, ros_parameter_file


class ReadFile:
    """Stands for a node that was started with a parameter file."""

    def __init__(self, text: str) -> None:
        (content,) = yaml.safe_load(text).values()
        self._values: dict[str, Any] = flatten_names(content["ros__parameters"])
        self.declared: dict[str, Any] = {}

    def list_parameters(self, _prefixes: list[str], _depth: int) -> Any:
        return SimpleNamespace(names=list(self._values))

    def get_parameter(self, name: str) -> Any:
        return SimpleNamespace(value=self._values[name])

    def get_name(self) -> str:
        return "node"

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=print)

    def undeclare_parameter(self, name: str) -> None:
        pass

    def declare_parameter(self, name: str, value: Any, _descriptor: Any, **_: Any) -> None:
        self.declared[name] = value


def flatten_names(nested: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for name, value in nested.items():
        flat.update(flatten_names(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name: value})
    return flat


def test_a_list_that_is_empty_against_its_default_arrives_empty() -> None:
    """`--set bridge.wait_for=[]` was lost: the bridge waited for its default all the same, and gave up after 15 s."""
    assert BridgeParams().wait_for == ("controller",)
    wanted = load_scenario("paper_planar", mode="realtime", assignments=["bridge.wait_for=[]"]).bridge
    for complete in (False, True):
        node = ReadFile(ros_parameter_file(wanted, "bridge", complete=complete))
        assert declare(node, BridgeParams) == wanted
        assert node.declared["wait_for"] == []
