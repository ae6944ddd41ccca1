"""Listens to two topics until one is heard, and a while longer; prints what was heard, and who is known."""

import time

import rclpy
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

PATIENCE_S, LONGER_S = 20.0, 1.0

rclpy.init(args=[])
node = rclpy.create_node("stranger", start_parameter_services=False, enable_rosout=False)
heard: dict[str, list[object]] = {"joint_states": [], "wrench": []}
node.create_subscription(JointState, "joint_states", heard["joint_states"].append, 10)
node.create_subscription(WrenchStamped, "wrench", heard["wrench"].append, 10)
end = time.monotonic() + PATIENCE_S
while time.monotonic() < end:
    rclpy.spin_once(node, timeout_sec=0.05)
    if len(heard["wrench"]) == 1:
        end = min(end, time.monotonic() + LONGER_S)
for name, messages in heard.items():
    print(f"{name}: {'heard' if messages else 'nothing'}, {node.count_publishers(name)} known", flush=True)
