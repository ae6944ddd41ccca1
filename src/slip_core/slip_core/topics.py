"""The one table of topics: publishers, subscribers, recorder, launcher and documentation all read it.

Names are relative, so a namespace moves the whole system; only ``/clock`` and ``/diagnostics`` are
absolute, as ROS fixes them. Several arms on one object have the topics of an arm each below its name, as ``left/``.
This module is data: it imports no ROS.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from slip_core.errors import InputError, UnknownName

WORLD = "world"
"""Frame in which poses of the object, the pads and references are."""
Owner = Literal["bridge", "controller", "user"]


@dataclass(frozen=True, slots=True)
class Topic:
    """One topic: its relative name, message type, who publishes it, QoS and meaning.

    `latched` topics are reliable, transient local, depth 1. All others are volatile; publishers offer
    reliable with `depth` samples of history, because a recorder on a busy machine may be seconds behind.
    common: several arms have one together, not one each below its name; several: only they have it.
    """

    name: str
    type: str
    publisher: Owner
    description: str
    latched: bool = False
    depth: int = 10000
    common: bool = False
    several: bool = False


EVENTS = "/parameter_events"
"""ROS's topic of parameter changes at run time."""
_TABLE = (
    Topic("joint_states", "sensor_msgs/msg/JointState", "bridge", "joint positions [rad], velocities [rad/s], efforts [N m]"),
    Topic("wrench", "geometry_msgs/msg/WrenchStamped", "bridge", "wrench of the object on the robot at the pad centre [N, N m], pad axes"),
    Topic("slip_velocity", "geometry_msgs/msg/TwistStamped", "bridge", "slip velocity of the pad relative to the object [m/s, rad/s], pad axes; NaN = invalid"),
    Topic("slip_displacement", "geometry_msgs/msg/PoseStamped", "bridge", "if `slip_input` is displacement: pose of the pad relative to where it grasped the object; NaN = invalid"),
    Topic("slip_flag", "sensor_msgs/msg/JointState", "bridge", "if `slip_input` is flag: named flags (position field), 1 = slips, 0 = holds, NaN = unknown, stamped at the measurement"),
    Topic("object_state", "nav_msgs/msg/Odometry", "bridge", "ground truth: pose of the object's COM in `world`, twist in object axes", common=True),
    Topic("slip_truth", "sensor_msgs/msg/JointState", "bridge", "ground truth: slip displacement (position) and slip velocity (velocity), names s_x .. s_rz"),
    Topic("internal_wrench", "geometry_msgs/msg/WrenchStamped", "bridge", "several arms, ground truth: part of the pad's wrench that does not move the object [N, N m], pad axes", several=True),
    Topic("lockstep_tick", "std_msgs/msg/Int64MultiArray", "bridge", "lockstep only: tick, stamp (sec, nsec), then wrench and slip samples published so far per contact, arm by arm", common=True),
    Topic("/clock", "rosgraph_msgs/msg/Clock", "bridge", "simulation time", common=True),
    Topic("robot_description", "std_msgs/msg/String", "bridge", "URDF of the arm", latched=True),
    Topic("object_description", "std_msgs/msg/String", "bridge", "URDF of the grasped object: one link `object`, for display", latched=True, common=True),
    Topic("grip_command", "std_msgs/msg/Float64", "controller", "if `grip.control` is follow: grip force that the path needs [N], sum over both pads, one per cycle"),
    Topic("reference", "trajectory_msgs/msg/MultiDOFJointTrajectory", "user", "desired pose, twist and acceleration of `ee` in `world`, with several arms of the object's centre of mass: one point per message", depth=10, common=True),
    Topic("goal", "trajectory_msgs/msg/MultiDOFJointTrajectory", "user", "if `trajectory.kind` is goal: pose of `ee` in `world`, with several arms of the object's centre of mass, to reach within `time_from_start`: one point per message", depth=10, common=True),
    Topic("effort_command", "sensor_msgs/msg/JointState", "controller", "joint efforts [N m], with the stamp of the joint state they answer"),
    Topic("effort_controller/commands", "std_msgs/msg/Float64MultiArray", "controller", "the same efforts for ros2_control's effort controllers, if `publish_effort_array` is set"),
    Topic("velocity_command", "sensor_msgs/msg/JointState", "controller", "if `command.interface` is velocity: joint velocities [rad/s], with the stamp of the joint state they answer"),
    Topic("velocity_controller/commands", "std_msgs/msg/Float64MultiArray", "controller", "the same velocities for ros2_control's velocity controllers"),
    Topic("position_command", "sensor_msgs/msg/JointState", "controller", "if `command.interface` is position: joint positions [rad], with the stamp of the joint state they answer"),
    Topic("position_controller/commands", "std_msgs/msg/Float64MultiArray", "controller", "the same positions for ros2_control's position controllers"),
    Topic("controller/scalars", "sensor_msgs/msg/JointState", "controller", "every symbol of the tick as named scalars (position field)"),
    Topic("controller/ee_pose", "geometry_msgs/msg/PoseStamped", "controller", "pose of the pad centre in `world`"),
    Topic("controller/reference_pose", "geometry_msgs/msg/PoseStamped", "controller", "desired pose of the pad centre in `world`"),
    Topic("controller/joint_estimate", "sensor_msgs/msg/JointState", "controller", "if joint states are estimated: position [rad], velocity [rad/s] and disturbance [N m] of each joint"),
    Topic("controller/ledger", "std_msgs/msg/Int64MultiArray", "controller", "per cycle: number, stamps of the samples used; then the controller's clock, mode, faults of the inputs, request"),
    Topic("controller/timing", "sensor_msgs/msg/JointState", "controller", "real time only, per cycle: period, ages, compute time, latency [s]; overruns, missed"),
    Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "controller", "mode and reason, in real time also overruns and missed states, about once a second", depth=100, common=True),
    Topic("controller/mode", "std_msgs/msg/String", "controller", "WAITING_INPUT, HOLD, ACTIVE, DEGRADED or FAULT, and the reason; sent on every change", latched=True),
    Topic("controller/goal", "std_msgs/msg/String", "controller", "if `trajectory.kind` is goal: state of the goal: moves, reached, or refused and why; sent on every change", latched=True, common=True),
    Topic("controller/reference_used", "trajectory_msgs/msg/MultiDOFJointTrajectory", "controller", "every accepted reference or goal, unchanged: the ledger counts them, so that a bag can be replayed", common=True),
    Topic("controller/ready", "std_msgs/msg/String", "controller", "sent once, when all peers are matched", latched=True, common=True),
)  # fmt: skip

TOPICS = MappingProxyType({topic.name: topic for topic in _TABLE})


def topic(name: str) -> Topic:
    """Return the table's row of `name`; the prefix of a further contact, `contact_1/`, is ignored.

    Raises:
        InputError: where the table has no such topic.
    """
    try:
        return TOPICS[re.sub(r"^contact_\d+/", "", name)]
    except KeyError:
        raise UnknownName("topic", name, TOPICS) from None


def contact_topic(name: str, contact: int) -> str:
    """Return the topic of contact number `contact`: ``wrench``, then ``contact_1/wrench`` and so on."""
    return name if contact == 0 else f"contact_{contact}/{name}"


def checked_namespace(_context: object, _option: object, text: str) -> str:
    """Return a namespace from the command line; a callback of its option, which works without ROS.

    Raises:
        InputError: it is none to ROS.
    """
    if re.fullmatch(r"/?|/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*/?", text, re.ASCII) is None or "__" in text:
        raise InputError(f"--namespace {text}", got="a name that ROS refuses", expected="letters, digits, _ and /")
    return text


def markdown_table() -> str:
    """Return the table for the documentation."""
    lines = ["| topic | type | from | QoS | meaning |", "|---|---|---|---|---|"]
    for row in _TABLE:
        qos = "reliable, transient local, 1" if row.latched else f"reliable, volatile, {row.depth}"
        lines.append(
            f"| `{row.name}` | `{row.type}` | {row.publisher} | {qos} | {'*one*: ' if row.common else ''}{row.description} |"
        )
    return "\n".join(lines)
