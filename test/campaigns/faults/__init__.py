"""Fault campaign in process: seeded faults on every topic and node, monitors on every message."""
