"""What the nodes share with ROS: QoS, values to and from messages, executor, node start."""
