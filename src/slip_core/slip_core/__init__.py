"""What every package shares, without ROS: errors, parameters, topic table, values, vectors, records, compiled code."""
