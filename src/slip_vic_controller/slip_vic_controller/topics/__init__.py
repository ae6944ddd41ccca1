"""The node over ROS: the topics of one arm, its goals, its mode."""
