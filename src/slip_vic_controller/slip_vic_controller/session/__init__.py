"""The controller between cycles: what is configured, the session of one arm and that of all, the result of a cycle."""
