"""Supervised bring-up: from running drivers to a first governed motion, step by step; `slip-vic bringup`.

`walk` is the steps with their checks; `hands` pushes and pulls; `ros_system` is the controller with its drivers over
DDS; `heard` is what it sends.
"""
