"""Record, inspect, play, export and recover ROS 2 bags without rosbag2; has nothing to do with slip.

Files are rosbag2 version 9 folders (``metadata.yaml`` and MCAP). Only `recorder` and `player` need ROS;
reading, export and recovery work without it.
"""
