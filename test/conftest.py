"""Fixtures shared by all tests."""

import hypothesis

from test.support.ros import processes, ros_domain, ros_node  # noqa: F401  # fixtures are found by name

# A deadline would make a crowded machine fail tests that have nothing to do with time; random means seeded.
hypothesis.settings.register_profile("suite", deadline=None, derandomize=True)
hypothesis.settings.load_profile("suite")
