"""python examples/gripper_adapter.py robotiq|action [--ros-args ...]: `grip_command` to what a gripper's driver takes.

robotiq: registers 0 to 5 of a 2F gripper (its manual, "Control") as std_msgs/UInt8MultiArray on `robotiq_registers`.
action: control_msgs/action/GripperCommand on `gripper_action`, which the drivers of the Franka Hand and of ros2_control
have. Not run on hardware: begin with a soft object.
"""

import sys

import rclpy
from rclpy.node import Node
from std_msgs.msg import Float64, UInt8MultiArray

PERIOD_S, STEP_N = 0.05, 0.1
"""How often the gripper gets a new force, and the change of it that is worth one."""
LEAST_N, MOST_N = 10.0, 125.0  # of each finger of a 2F-140, at 0 and 255
ACTIVATE_AND_GO, CLOSED, SLOW = 0x09, 255, 0


class Adapter(Node):
    """Sends the newest grip command, half of it for each finger."""

    def __init__(self, form: str) -> None:
        super().__init__("gripper_adapter")
        self.wanted, self.sent = 0.0, -1.0
        self.create_subscription(Float64, "grip_command", self.take, 1000)
        if form == "robotiq":
            self.send, self.publisher = self.registers, self.create_publisher(UInt8MultiArray, "robotiq_registers", 10)
        else:
            from control_msgs.action import GripperCommand
            from rclpy.action import ActionClient

            self.send, self.goal = self.action, GripperCommand.Goal()
            self.client = ActionClient(self, GripperCommand, "gripper_action")
        self.create_timer(PERIOD_S, self.step)

    def take(self, message: Float64) -> None:
        """Keep the newest command."""
        self.wanted = max(message.data, 0.0)

    def step(self) -> None:
        """Send what has changed."""
        if abs(self.wanted - self.sent) > STEP_N:
            self.send(0.5 * self.wanted)
            self.sent = self.wanted

    def registers(self, finger: float) -> None:
        """Publish the registers of a force of each finger [N]."""
        share = min(max((finger - LEAST_N) / (MOST_N - LEAST_N), 0.0), 1.0)
        self.publisher.publish(UInt8MultiArray(data=bytes([ACTIVATE_AND_GO, 0, 0, CLOSED, SLOW, round(255 * share)])))

    def action(self, finger: float) -> None:
        """Send a goal with a force of each finger [N]."""
        self.goal.command.max_effort = finger
        self.client.send_goal_async(self.goal)


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(Adapter(sys.argv[1] if sys.argv[1:] else "action"))
