"""Parameters of the controller by theme; `params` holds them all."""
