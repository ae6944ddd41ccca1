"""One law of each school, from its publication: formulas and numbers, no code."""
