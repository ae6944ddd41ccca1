"""python examples/cartesian_impedance_node.py        (needs ROS; the simulator in another terminal:)
slip_sim_bridge_node --ros-args --params-file config/glass_transport/bridge.yaml

A law in plain rclpy: impedance of the pad, which carries the glass pane to its goal. In lockstep the simulator waits
for the effort with the stamp of its joint state; it begins after `controller/ready`."""

import contextlib

import numpy as np
import pinocchio as pin
import rclpy.executors
from geometry_msgs.msg import TwistStamped, WrenchStamped
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

GOAL, LASTS = np.array([0.1, 0.45, 0.0, 0.0, 0.0, 0.5]), 1.5  # m, rad from the start on world axes; s
STIFFNESS, DAMPING, JOINT_DAMPING = 100.0, 20.0, 2.0  # 1/s2, 1/s: of a unit mass; N m s/rad, in the null space
KEPT, AXES = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL), pin.LOCAL_WORLD_ALIGNED


class CartesianImpedance(Node):  # noqa: D101
    def start(self, urdf: String) -> None:  # noqa: D102
        self.model, self.h, self.begin = pin.buildModelFromXML(urdf.data), np.zeros(6), None
        self.data, self.ee = self.model.createData(), self.model.getFrameId("ee")
        self.publisher = self.create_publisher(JointState, "effort_command", 10)
        self.create_subscription(JointState, "joint_states", self.answer, 10)
        self.create_subscription(WrenchStamped, "wrench", self.feel, 10)
        self.create_subscription(TwistStamped, "slip_velocity", lambda slip: None, 10)  # a law of yours reads it
        self.create_publisher(String, "controller/ready", KEPT).publish(String(data="ready"))

    def feel(self, message: WrenchStamped) -> None:  # noqa: D102
        self.h = np.ravel([[part.x, part.y, part.z] for part in (message.wrench.force, message.wrench.torque)])

    def answer(self, state: JointState) -> None:
        """Publish tau = J^T (Lambda (a - Jdot qd) - h) + C qd + g + N^T tau_0 for one joint state."""
        model, data, q, qd = self.model, self.data, np.array(state.position), np.array(state.velocity)
        pin.forwardKinematics(model, data, q, qd, np.zeros_like(q))
        J, pad = pin.computeFrameJacobian(model, data, q, self.ee, AXES), pin.updateFramePlacement(model, data, self.ee)
        now = state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec
        since, start = self.begin = self.begin or (now, pad.copy())
        t = min((now - since) / LASTS, 1.0)
        wanted, rate = GOAL * t**3 * (10 - 15 * t + 6 * t * t), GOAL * 30 * (t * (1 - t)) ** 2 / LASTS
        turn = pin.log3(pin.exp3(wanted[3:]) @ start.rotation @ pad.rotation.T)
        error = np.r_[start.translation + wanted[:3] - pad.translation, turn]
        a = GOAL * 60 * t * (1 - t) * (1 - 2 * t) / LASTS**2 + STIFFNESS * error + DAMPING * (rate - J @ qd)
        a -= pin.getFrameClassicalAcceleration(model, data, self.ee, AXES).vector  # Jdot qd
        Minv, rest = np.linalg.inv(pin.crba(model, data, q)), -JOINT_DAMPING * qd
        force = np.linalg.solve(J @ Minv @ J.T, a - J @ Minv @ rest) - np.kron(np.eye(2), pad.rotation) @ self.h
        effort = J.T @ force + rest + pin.nonLinearEffects(model, data, q, qd)
        self.publisher.publish(JointState(header=state.header, name=state.name, effort=effort.tolist()))


if __name__ == "__main__":
    rclpy.init()
    node = CartesianImpedance("cartesian_impedance")
    node.create_subscription(String, "robot_description", node.start, KEPT)
    with contextlib.suppress(KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
        rclpy.spin(node)
