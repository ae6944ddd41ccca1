"""Supervised bring-up: from drivers that run to a first governed motion, step by step; `slip-vic bringup`.

`verdicts` judges numbers and knows nothing else; `walk` is the order of the steps; `ros_system` is the controller
with its drivers over DDS, and thin.
"""
