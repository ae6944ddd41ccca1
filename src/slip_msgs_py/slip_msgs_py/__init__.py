"""Shared vocabulary of the suite: value objects, errors, parameters, topics, message conversion.

The pure half (`types`, `arrays`, `errors`, `params`, `topics`, `from_msgs`, `resources`) never imports ROS;
the ROS half (`qos`, `to_msgs`, `ros_params`, `node_main`) does.
"""
