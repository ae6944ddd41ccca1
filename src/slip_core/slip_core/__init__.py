"""What every package shares, without ROS: errors, parameters, topic table, values, vectors, the compiler's door."""
