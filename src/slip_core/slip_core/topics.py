"""The one table of topics: publishers, subscribers, recorder, launcher and documentation all read it.

Names are relative, so a namespace moves the whole system; only ``/clock`` and ``/diagnostics`` are
absolute, as ROS fixes them. Several arms on one object have the topics of an arm each below its name, as ``left/``.
This module is data: it imports no ROS.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from slip_core.errors import UnknownName

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


_TABLE = (
    Topic("joint_states", "sensor_msgs/msg/JointState", "bridge", "joint positions [rad], velocities [rad/s], efforts [N m]"),
    Topic("wrench", "geometry_msgs/msg/WrenchStamped", "bridge", "wrench of the object on the robot at the pad centre [N, N m], pad axes"),
    Topic("slip_velocity", "geometry_msgs/msg/TwistStamped", "bridge", "slip velocity of the pad relative to the object [m/s, rad/s], pad axes; NaN = invalid"),
    Topic("slip_displacement", "geometry_msgs/msg/PoseStamped", "bridge", "where `slip_input` is displacement: pose of the pad as seen from where it took the object; NaN = invalid"),
    Topic("slip_flag", "sensor_msgs/msg/JointState", "bridge", "where `slip_input` is flag: named flags (position field), 1 = slips, 0 = holds, NaN = unknown, stamped when it was so"),
    Topic("object_state", "nav_msgs/msg/Odometry", "bridge", "ground truth: pose of the object's COM in `world`, twist in object axes", common=True),
    Topic("slip_truth", "sensor_msgs/msg/JointState", "bridge", "ground truth: slip displacement (position) and slip velocity (velocity), names s_x .. s_rz"),
    Topic("internal_wrench", "geometry_msgs/msg/WrenchStamped", "bridge", "several arms, ground truth: the part of the pad's wrench that does not move the object [N, N m], pad axes", several=True),
    Topic("lockstep_tick", "std_msgs/msg/Int64MultiArray", "bridge", "lockstep only: tick, stamp (sec, nsec), then wrench and slip samples published so far per contact, of several arms one after the other", common=True),
    Topic("/clock", "rosgraph_msgs/msg/Clock", "bridge", "simulation time", common=True),
    Topic("robot_description", "std_msgs/msg/String", "bridge", "URDF of the arm", latched=True),
    Topic("object_description", "std_msgs/msg/String", "bridge", "URDF of the grasped object: one link `object`, for display", latched=True, common=True),
    Topic("grip_force", "std_msgs/msg/Float64", "user", "grip force for the simulated gripper [N]", depth=10),
    Topic("grip_command", "std_msgs/msg/Float64", "controller", "where `grip.control` is follow: grip force that the path needs [N], sum over both pads, one per cycle"),
    Topic("reference", "trajectory_msgs/msg/MultiDOFJointTrajectory", "user", "desired pose, twist and acceleration of `ee` in `world`, of several arms of the object's centre of mass: one point per message", depth=10, common=True),
    Topic("joint_trajectory", "trajectory_msgs/msg/JointTrajectory", "user", "one arm, `trajectory.kind` topic: a planner's path of the joints, positions and times of its points; the pad follows it, governed where `governor.mode` is set", depth=10, common=True),
    Topic("goal", "trajectory_msgs/msg/MultiDOFJointTrajectory", "user", "pose of `ee` in `world`, of several arms of the object's centre of mass, to come to rest at, in `time_from_start`: one point per message, where `trajectory.kind` is goal", depth=10, common=True),
    Topic("effort_command", "sensor_msgs/msg/JointState", "controller", "joint efforts [N m], stamped as the joint state they answer"),
    Topic("effort_controller/commands", "std_msgs/msg/Float64MultiArray", "controller", "the same efforts for ros2_control's effort controllers, where `publish_effort_array` is set"),
    Topic("velocity_command", "sensor_msgs/msg/JointState", "controller", "where `command.interface` is velocity: joint velocities [rad/s], stamped as the joint state they answer"),
    Topic("velocity_controller/commands", "std_msgs/msg/Float64MultiArray", "controller", "the same velocities for ros2_control's velocity controllers"),
    Topic("position_command", "sensor_msgs/msg/JointState", "controller", "where `command.interface` is position: joint positions [rad], stamped as the joint state they answer"),
    Topic("position_controller/commands", "std_msgs/msg/Float64MultiArray", "controller", "the same positions for ros2_control's position controllers"),
    Topic("controller/scalars", "sensor_msgs/msg/JointState", "controller", "every symbol of the tick as named scalars (position field)"),
    Topic("controller/stiffness", "geometry_msgs/msg/WrenchStamped", "controller", "diagonal of K(v_s) [N/m, N m/rad]"),
    Topic("controller/damping", "geometry_msgs/msg/WrenchStamped", "controller", "diagonal of D(v_s) [N s/m, N m s/rad]"),
    Topic("controller/ee_pose", "geometry_msgs/msg/PoseStamped", "controller", "pose of the pad centre in `world`"),
    Topic("controller/reference_pose", "geometry_msgs/msg/PoseStamped", "controller", "desired pose of the pad centre in `world`"),
    Topic("controller/reference_twist", "geometry_msgs/msg/TwistStamped", "controller", "desired twist of the pad centre in `world`"),
    Topic("controller/joint_estimate", "sensor_msgs/msg/JointState", "controller", "where `joint_sensor` is configured as noisy: estimated position [rad], velocity [rad/s] and disturbance [N m] of each joint"),
    Topic("controller/ledger", "std_msgs/msg/Int64MultiArray", "controller", "per cycle: number, stamps of the samples used; then the controller's clock, mode, faults of the inputs, request"),
    Topic("controller/timing", "sensor_msgs/msg/JointState", "controller", "real time only, per cycle: period, ages, compute time, latency [s]; overruns, missed, stale"),
    Topic("bridge/timing", "sensor_msgs/msg/JointState", "bridge", "real time only, per tick: period, lateness, state-to-command latency [s]; fresh share, overruns, real-time factor", common=True),
    Topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "controller", "mode and reason, in real time also the timing, about once a second", depth=100, common=True),
    Topic("controller/mode", "std_msgs/msg/String", "controller", "WAITING_INPUT, HOLD, ACTIVE, DEGRADED or FAULT, and the reason; sent where it changes", latched=True),
    Topic("controller/goal", "std_msgs/msg/String", "controller", "what becomes of goals and joint trajectories: moves, reached, or refused and why; sent where it changes, where `trajectory.kind` is goal or topic", latched=True, common=True),
    Topic("controller/reference_used", "trajectory_msgs/msg/MultiDOFJointTrajectory", "controller", "every reference or goal that the controller took, as it came: the ledger counts them, so that a bag replays", common=True),
    Topic("controller/ready", "std_msgs/msg/String", "controller", "sent once, when every peer is matched", latched=True, common=True),
)  # fmt: skip

TOPICS = MappingProxyType({topic.name: topic for topic in _TABLE})


def topic(name: str) -> Topic:
    """Return the table's row of `name`.

    Raises:
        InputError: where the table has no such topic.
    """
    try:
        return TOPICS[name]
    except KeyError:
        raise UnknownName("topic", name, TOPICS) from None


def contact_topic(name: str, contact: int) -> str:
    """Return the topic of contact number `contact`: ``wrench``, then ``contact_1/wrench`` and so on."""
    return name if contact == 0 else f"contact_{contact}/{name}"


def markdown_table() -> str:
    """Return the table for the documentation."""
    lines = ["| topic | type | from | QoS | meaning |", "|---|---|---|---|---|"]
    for row in _TABLE:
        qos = "reliable, transient local, 1" if row.latched else f"reliable, volatile, {row.depth}"
        lines.append(
            f"| `{row.name}` | `{row.type}` | {row.publisher} | {qos} | {'*one*: ' if row.common else ''}{row.description} |"
        )
    return "\n".join(lines)
