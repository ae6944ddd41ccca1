"""python examples/joint_pd_node.py        (needs ROS; the simulator in another terminal:)
slip_sim_bridge_node --ros-args --params-file config/paper_planar/bridge.yaml

A controller in plain rclpy that answers the simulator: joint PD that holds the start. In lockstep the simulator waits
for the effort that carries the stamp of its joint state, and begins when `controller/ready` has been published and its
three inputs of a controller have subscribers.
"""

import contextlib

import rclpy
import rclpy.executors
from geometry_msgs.msg import TwistStamped, WrenchStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

STIFFNESS, DAMPING = 400.0, 40.0  # N m/rad, N m s/rad


class JointPD(Node):
    """Holds the joints where it finds them."""

    def __init__(self) -> None:
        super().__init__("joint_pd")
        self.start: JointState | None = None
        self.answered = 0
        self.publisher = self.create_publisher(JointState, "effort_command", 10)
        self.create_subscription(JointState, "joint_states", self.answer, 10)
        self.create_subscription(WrenchStamped, "wrench", lambda wrench: None, 10)  # a law of yours reads these two
        self.create_subscription(TwistStamped, "slip_velocity", lambda slip: None, 10)
        self.ready = self.create_publisher(
            String, "controller/ready", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        )
        self.ready.publish(String(data="ready"))

    def answer(self, state: JointState) -> None:
        """Publish the efforts for one joint state."""
        self.start = self.start or state  # its effort is what holds the arm's weight and the object's
        command = JointState(header=state.header, name=state.name)
        command.effort = [
            held + STIFFNESS * (q0 - q) - DAMPING * qd
            for held, q0, q, qd in zip(
                self.start.effort, self.start.position, state.position, state.velocity, strict=True
            )
        ]
        self.publisher.publish(command)
        self.answered += 1
        if self.answered % 1000 == 1:
            worst = max(abs(q0 - q) for q0, q in zip(self.start.position, state.position, strict=True))
            self.get_logger().info(f"{self.answered} joint states answered, {worst:.4f} rad from the start")


if __name__ == "__main__":
    rclpy.init()
    with contextlib.suppress(KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        rclpy.spin(JointPD())
