"""Launcher, bags, demo, report and the slip-vic command line."""

__version__ = "0.1.0"
