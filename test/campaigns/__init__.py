"""Fault campaigns, long runs and benchmarks: for developers, and part of no package."""
