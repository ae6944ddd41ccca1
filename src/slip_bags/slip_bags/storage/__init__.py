"""MCAP files: written, read by their index, and what can be saved of a damaged one."""
