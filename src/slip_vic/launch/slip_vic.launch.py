"""Bridge, controller and, where `record` names a folder, recorder: what `slip-vic run` starts, for `ros2 launch`.

    ros2 launch slip_vic slip_vic.launch.py scenario:=glass_transport record:=out/glass
    ros2 launch slip_vic slip_vic.launch.py namespace:=left set:='object.mass=0.6 controller.gains.k_s=500'
    ros2 launch slip_vic slip_vic.launch.py scenario:=pane_two_arms_upright
    ros2 launch slip_vic slip_vic.launch.py bridge:=false mode:=realtime prefix:='chrt -f 80'

The end is that of `slip-vic run` too: when the bridge has ended, the controller is asked to end, and then the recorder.
"""

import atexit
import shlex
import shutil
import signal
import tempfile
from pathlib import Path

from launch import LaunchContext, LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.event_handlers import OnProcessExit
from launch.events import matches_action
from launch.events.process import SignalProcess
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from slip_vic.run.node_command import launch_plan

ARGUMENTS = (
    DeclareLaunchArgument("scenario", default_value="paper_planar", description="name, or path of a .yaml file"),
    DeclareLaunchArgument(
        "law", default_value="governed", choices=["vic", "classical", "governed"], description="control law"
    ),
    DeclareLaunchArgument("mode", default_value="lockstep", choices=["lockstep", "realtime"], description="pacing"),
    DeclareLaunchArgument("seed", default_value="0", description="seed of the sensor noise"),
    DeclareLaunchArgument("set", default_value="", description="parameters: KEY=VALUE, separated by spaces"),
    DeclareLaunchArgument("urdf", default_value="", description="another arm: path of its URDF"),
    DeclareLaunchArgument("namespace", default_value="", description="ROS namespace of all nodes"),
    DeclareLaunchArgument("record", default_value="", description="new folder for a bag; empty records nothing"),
    DeclareLaunchArgument(
        "bridge",
        default_value="true",
        choices=["true", "false"],
        description="false: a real arm's driver takes its place",
    ),
    DeclareLaunchArgument("prefix", default_value="", description="words before the commands of bridge and controller"),
)


def system(context: LaunchContext) -> list:
    """Return the processes of one run, and what happens when one of them ends."""

    def value(name: str) -> str:
        return LaunchConfiguration(name).perform(context)

    folder = Path(tempfile.mkdtemp(prefix="slip_vic_"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    namespace = value("namespace")
    plan = launch_plan(
        folder,
        scenario=value("scenario"),
        law=value("law"),
        mode=value("mode"),
        seed=int(value("seed")),
        assignments=shlex.split(value("set")),
        urdf=value("urdf"),
        namespace=namespace,
        bag=value("record"),
        with_bridge=value("bridge") == "true",
    )
    controller = Node(
        package="slip_vic_controller",
        executable="slip_vic_controller_node",
        namespace=namespace,
        parameters=[str(plan.controller)],
        prefix=value("prefix"),
        output="screen",
    )
    entities = [controller, RegisterEventHandler(OnProcessExit(target_action=controller, on_exit=[Shutdown()]))]
    if plan.recorder:
        recorder = ExecuteProcess(cmd=plan.recorder, output="screen")
        entities += [recorder, RegisterEventHandler(OnProcessExit(target_action=recorder, on_exit=[Shutdown()]))]
    if plan.bridge is not None:
        bridge = Node(
            package="slip_sim_bridge",
            executable="slip_sim_bridge_node",
            namespace=namespace,
            parameters=[str(plan.bridge)],
            prefix=value("prefix"),
            output="screen",
        )
        end = SignalProcess(signal_number=signal.SIGINT, process_matcher=matches_action(controller))
        handler = OnProcessExit(target_action=bridge, on_exit=[EmitEvent(event=end)])
        entities += [bridge, RegisterEventHandler(handler)]
    return entities


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` runs."""
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=system)])
