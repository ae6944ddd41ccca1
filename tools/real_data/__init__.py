"""Recorded runs of a real robot: read, put in a small table, modelled, predicted; see docs/real_runs.md."""
