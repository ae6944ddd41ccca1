"""Recorded runs of a real robot: read, put in a small table, modelled, predicted; docs/evidence/real-data.csv."""
