"""Experiments: worlds that differ from the configuration, laws in them, and rows, tables and pictures of the runs."""
