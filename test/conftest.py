"""Fixtures shared by all tests."""

from test.support.ros import processes, ros_domain, ros_node  # noqa: F401  # fixtures are found by name
