"""Fixtures shared by all tests."""

import os

import hypothesis

from slip_msgs_py.node_shell import LOUD_VARIABLE
from test.support.ros import (  # noqa: F401  # fixtures are found by name
    processes,
    ros_domain,
    ros_node,
    shared_domain,
    shared_node,
    shared_processes,
)

os.environ.setdefault(LOUD_VARIABLE, "1")  # a bug that a node outlives is none that a test may miss

# A deadline would make a crowded machine fail tests that have nothing to do with time; random means seeded.
hypothesis.settings.register_profile("suite", deadline=None, derandomize=True)
hypothesis.settings.load_profile("suite")
