"""Bring your law: the way in for laws of one's own, and the benchmark that compares them."""
