"""The frozen judge: 960 worlds as data, how the code before a change did in them, and whether it does worse now."""
