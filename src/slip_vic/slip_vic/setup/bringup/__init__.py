"""Supervised bring-up: from running drivers to a first governed motion, step by step; `slip-vic bringup`.

`verdicts` judges numbers; `walk` is the order of the steps; `hands` pushes and pulls; `ros_system` is the controller
with its drivers over DDS.
"""
