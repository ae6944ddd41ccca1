"""Launcher, bags, demo, report and the slip-vic command line."""
