"""Supervised bring-up: from drivers that run to a first governed motion, step by step; `slip-vic bringup`.

`verdicts` judges numbers and knows nothing else; `walk` is the order of the steps on any `System`; `ros_system` is the
system over DDS, and thin.
"""
