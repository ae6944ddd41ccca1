"""An arm from nothing but its URDF: where its hand is, a posture to start from, and a scenario that runs."""
