"""Arm, grasp, friction and sensors, without ROS."""

import os

# No picture is drawn here. Without this, `import mujoco` looks for a window library in a process of its own.
os.environ.setdefault("MUJOCO_GL", "disable")
