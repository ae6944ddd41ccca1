"""Fixtures shared by all tests."""

import hypothesis

from test.support.ros import (  # noqa: F401  # fixtures are found by name
    processes,
    ros_domain,
    ros_node,
    shared_domain,
    shared_node,
    shared_processes,
)

# A deadline would make a crowded machine fail tests that have nothing to do with time; random means seeded.
hypothesis.settings.register_profile("suite", deadline=None, derandomize=True)
hypothesis.settings.load_profile("suite")
