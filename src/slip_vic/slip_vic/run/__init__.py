"""Run a scenario: in this process or as ROS nodes, record it, sum it up."""
