"""Fixtures of the bag tests."""

from ..support.ros import processes, ros_domain, ros_node

__all__ = ["processes", "ros_domain", "ros_node"]
