"""What the node hears and says over ROS: the topics of one arm, its goals, its mode."""
