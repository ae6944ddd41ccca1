"""The arm in RViz, its joints moved by sliders, or by a system that runs.

ros2 launch slip_description view_arm.launch.py
ros2 launch slip_description view_arm.launch.py sliders:=false    # shows /joint_states of `slip-vic run`
ros2 launch slip_description view_arm.launch.py urdf:=/path/to/my_arm.urdf rviz:=false
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

SHARE = Path(get_package_share_directory("slip_description"))


def nodes(context: LaunchContext) -> list:
    """Return the nodes; the URDF is a text for launch too, which would read it as YAML."""
    urdf = Path(LaunchConfiguration("urdf").perform(context)).read_text(encoding="utf-8")
    return [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            parameters=[{"robot_description": ParameterValue(urdf, value_type=str)}],
        ),
        Node(
            package="joint_state_publisher_gui",
            executable="joint_state_publisher_gui",
            condition=IfCondition(LaunchConfiguration("sliders")),
        ),
        Node(
            package="rviz2",
            executable="rviz2",
            arguments=["-d", str(SHARE / "rviz" / "arm.rviz")],
            condition=IfCondition(LaunchConfiguration("rviz")),
        ),
    ]


def generate_launch_description() -> LaunchDescription:
    """Return what `ros2 launch` runs."""
    arguments = [
        DeclareLaunchArgument("urdf", default_value=str(SHARE / "urdf" / "arm.urdf"), description="path of a URDF"),
        DeclareLaunchArgument("sliders", default_value="true", choices=["true", "false"], description="move by hand"),
        DeclareLaunchArgument("rviz", default_value="true", choices=["true", "false"], description="open RViz"),
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=nodes)])
