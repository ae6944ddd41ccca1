"""Record, inspect, play and recover ROS 2 bags without rosbag2; independent of slip control.

Bags are rosbag2 version 9 folders (``metadata.yaml`` and MCAP). Only recording and playing need ROS.
"""
