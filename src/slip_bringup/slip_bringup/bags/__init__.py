"""Bags: record, inspect, play, export, recover and verify ROS 2 recordings without rosbag2.

Files are rosbag2 version 9 folders (``metadata.yaml`` and MCAP). Only `recorder` and `player` need ROS;
reading, export, recovery and verification work without it.
"""
