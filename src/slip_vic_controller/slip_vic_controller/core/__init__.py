"""The control law as pure functions; no ROS, no clock, no randomness in here."""
