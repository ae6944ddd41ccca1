"""From the URDF of an arm to parameters, and from a robot that runs to its first motion."""
