"""The control cycle of all arms that hold one object: a module for each step; `cycle.py` calls them in order."""
