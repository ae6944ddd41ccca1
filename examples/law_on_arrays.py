"""python examples/law_on_arrays.py

The paper's law once, on plain arrays: what it answers to more and more slip. No simulator, no ROS, no parameter files.
"""

import numpy as np

import slip_vic

state = {
    "q": np.zeros(6), "qd": np.zeros(6), "J": np.eye(6), "M": np.eye(6), "bias": np.zeros(6),
    "position": [0.0, 0.0, 0.0], "rotation": np.eye(3),
    "desired_position": [0.01, 0.0, 0.0], "desired_rotation": np.eye(3),
    "wrench": [0.3, 0.0, 0.0, 0.0, 0.0, 0.0],
    "mass": 0.5, "inertia": 2e-3 * np.eye(3), "grasp_position": [0.02, 0.0, 0.0], "gravity": [0.0, 0.0, 0.0],
}  # fmt: skip
gains = {
    "stiffness": [400.0] * 3 + [4.5] * 3, "damping": [25.0] * 3 + [2.2] * 3, "desired_inertia": [0.4] * 3 + [0.3] * 3,
    "gamma_k": 100.0, "gamma_d": 100.0, "alpha": 100.0, "k_s": 100.0,
}  # fmt: skip

print("slip [mm/s]   stiffness [N/m]   gate   force along x [N]")
for slip in (0.0, 0.001, 0.003, 0.01, 0.03):
    found = slip_vic.evaluate_law(**state, **gains, slip_velocity=[slip, 0.0, 0.0, 0.0, 0.0, 0.0])
    print(f"{1e3 * slip:11.0f} {found.K[0]:17.1f} {found.gate:6.2f} {found.effort[0]:19.2f}")
