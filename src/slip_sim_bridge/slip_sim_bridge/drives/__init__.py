"""Simulated drives between a command and the joints: interface, dead time, lag, scale, offset, ripple, friction."""
