"""What the nodes share with ROS: QoS, values to and from messages, CDR codec, executor, node start."""
