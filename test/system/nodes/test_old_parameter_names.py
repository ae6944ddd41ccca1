"""A ROS parameter override under an old name: accepted, declared under the name of today, one warning in the log."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from slip_msgs_py.ros_params import declare
from slip_vic_controller.parameters.node_params import ControllerNodeParams

FILE = """
/**:
  ros__parameters:
    gains: {spin_lever: 0.0625}
"""


@pytest.mark.parametrize("how", ["command line", "file"])
def test_an_old_name_as_override(how: str, ros_domain: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    import rclpy
    from rclpy.node import Node

    path = tmp_path / "old.yaml"
    path.write_text(FILE)
    words = ["--params-file", str(path)] if how == "file" else ["-p", "gains.spin_lever:=0.0625"]
    context = rclpy.Context()
    rclpy.init(args=["--ros-args", *words], context=context, domain_id=ros_domain)
    node: Any = Node("old_names", context=context, automatically_declare_parameters_from_overrides=True)
    try:
        assert declare(node, ControllerNodeParams).gains.characteristic_length == 0.0625
        assert node.get_parameter("gains.characteristic_length").value == 0.0625
        assert not node.has_parameter("gains.spin_lever")
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)
    lines = [line for line in capfd.readouterr().err.splitlines() if "gains.spin_lever" in line]
    assert len(lines) == 1
    assert "gains.characteristic_length" in lines[0]
    assert "WARN" in lines[0]
