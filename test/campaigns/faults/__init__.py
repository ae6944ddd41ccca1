"""Fault campaigns: seeded faults on every topic and node, monitors on every message, in process and over DDS."""
