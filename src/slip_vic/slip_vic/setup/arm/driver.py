"""Into ros2_control: the controllers, the launch file and the remaps for the driver of an arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import yaml

from slip_vic_controller.params.controller_params import ControllerParams

CONTROLLERS = "controllers.yaml"
STATES, WRENCH = "joint_state_broadcaster", "slip_wrench_broadcaster"
"""Of joint states, which an arm's own launch file starts; of the wrench, under a name that none of them uses."""


class Driver(NamedTuple):
    """What an arm's ROS 2 driver is known by.

    drive: preset of its drives; states, wrench: its topics, wrench empty where it has none; sensor: of ros2_control,
    for the force and torque broadcaster, with the link that it is at; settings: of our controller; bare: nothing else
    starts the broadcaster of joint states.
    """

    drive: str = ""
    states: str = "joint_states"
    wrench: str = f"{WRENCH}/wrench"
    sensor: tuple[str, str] | None = None
    settings: Mapping[str, Any] = {}
    bare: bool = False


DRIVERS: Final = {
    "ur": Driver("velocity_500", sensor=("tcp_fts_sensor", "tool0"), settings={"wrench.frame": "tool0"}),
    "franka": Driver(
        "torque_joint", "franka/joint_states", "franka_robot_state_broadcaster/external_wrench_in_stiffness_frame",
        settings={"wrench.sign": -1, "effort.gravity": "robot_compensates"},
    ),
    "xarm": Driver("position_250", "xarm/joint_states", "xarm/uf_ftsensor_ext_states"),
    "kinova": Driver("position_250", wrench="", settings={"wrench.source": "none"}),
    "generic": Driver(sensor=("ft_sensor", ""), bare=True),
}  # fmt: skip
"""Topics and signs as in the sources of ur_robot_driver, franka_ros2 2.5, xarm_ros2 and ros2_kortex."""


def driver_files(driver: Driver, params: Mapping[str, ControllerParams], link: str) -> dict[str, str]:
    """Return controllers.yaml, and a launch file for each file of parameters by its name.

    Args:
        driver: of the arm.
        params: of our controller on the real arm.
        link: at its hand, where the driver's sensor is where none is known.
    """
    first = next(iter(params.values()))
    command, kind = f"forward_{first.command.interface}_controller", first.command.interface
    controllers: dict[str, dict[str, Any]] = {
        STATES: {"type": f"{STATES}/JointStateBroadcaster"},
        command: {
            "type": "forward_command_controller/ForwardCommandController",
            "joints": list(first.joint_names), "interface_name": kind,
        },
    }  # fmt: skip
    if driver.sensor is not None:
        name, at = driver.sensor
        of = "force_torque_sensor_broadcaster/ForceTorqueSensorBroadcaster"
        controllers[WRENCH] = {"type": of, "sensor_name": name, "frame_id": at or link}
    manager = {"update_rate": round(1.0 / first.control_period_s)} | {
        name: {"type": own["type"]} for name, own in controllers.items()
    }
    # A manager that runs already takes the type from the section of the controller.
    nodes = {"controller_manager": manager} | controllers
    text = yaml.safe_dump({name: {"ros__parameters": own} for name, own in nodes.items()}, sort_keys=False)
    spawned = [name for name in controllers if name != STATES or driver.bare]
    remaps = {
        "joint_states": driver.states,
        "wrench": driver.wrench,
        f"{kind}_controller/commands": f"{command}/commands",
    }
    return {CONTROLLERS: text} | {
        f"{file.partition('_controller')[0]}.launch.xml": _launch(file, spawned, remaps) for file in params
    }


def _launch(file: str, controllers: Sequence[str], remaps: Mapping[str, str]) -> str:
    """Return a launch file that spawns controllers, and starts ours with its parameters and remaps."""
    launch = Element("launch")
    for one in controllers:  # a spawner ends at the first that is active already
        spawned = f"{one} --param-file $(dirname)/{CONTROLLERS}"
        SubElement(launch, "node", pkg="controller_manager", exec="spawner", args=spawned)
    SubElement(launch, "arg", name="ros_args", default="", description="more arguments, as -p NAME:=VALUE")
    run = {"pkg": "slip_vic_controller", "exec": "slip_vic_controller_node", "ros_args": "$(var ros_args)"}
    node = SubElement(launch, "node", run, output="screen")
    SubElement(node, "param", {"from": f"$(dirname)/{file}"})
    for ours, theirs in remaps.items():
        if theirs not in ("", ours):
            SubElement(node, "remap", {"from": ours, "to": f"/{theirs}"})
    ElementTree.indent(launch)
    return ElementTree.tostring(launch, encoding="unicode") + "\n"
