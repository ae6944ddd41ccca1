"""A bridge, and a stranger on another machine that knows its address: two networks and a cable. Run by a test."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from slip_bringup.scenario import load_scenario
from slip_bringup.system.node_command import node_command
from slip_campaigns.faults.network import Cable

SECONDS, DOMAIN = 8.0, "7"
ENDLESS = ["bridge.stop_after_duration=false", "bridge.wait_for=[]"]
STRANGER = f"""
import time
import rclpy
from sensor_msgs.msg import JointState
rclpy.init(args=[])
node, heard = rclpy.create_node("stranger"), []
node.create_subscription(JointState, "joint_states", heard.append, 10)
publisher = node.create_publisher(JointState, "effort_command", 10)
end = time.monotonic() + {SECONDS}
while time.monotonic() < end and not (heard and publisher.get_subscription_count()):
    rclpy.spin_once(node, timeout_sec=0.05)
print("heard", bool(heard), "is heard", publisher.get_subscription_count() > 0, flush=True)
"""


def main() -> None:
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    scenario = load_scenario("paper_planar", mode="realtime", assignments=ENDLESS)
    told = {"ROS_DOMAIN_ID": DOMAIN}
    far = {**told, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_STATIC_PEERS": "10.93.0.1"}
    with Cable() as cable, tempfile.TemporaryDirectory() as folder:
        command = node_command("bridge", scenario.bridge, Path(folder))
        bridge = subprocess.Popen(command, env={**os.environ, **told}, stdout=subprocess.PIPE)
        try:
            assert bridge.stdout is not None
            assert bridge.stdout.readline(), "the bridge did not start"  # its first event
            stranger = cable.behind([sys.executable, "-c", STRANGER])
            subprocess.run(stranger, env={**os.environ, **far}, check=True)
        finally:
            bridge.kill()
            bridge.wait()


if __name__ == "__main__":
    main()
