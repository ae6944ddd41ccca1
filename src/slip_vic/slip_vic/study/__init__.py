"""Scenario x sensor x estimator x mismatch x seed, in parallel processes, to one table and one picture."""
