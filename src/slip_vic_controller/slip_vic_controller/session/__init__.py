"""The controller between cycles: configuration, the session of one arm and that of all, the result of a cycle."""
