"""python examples/read_bag.py [BAG]

A recorded run with pandas: its topics, when the object slips, the arm's efforts in between. No ROS is needed.
"""

import sys

import numpy as np

import slip_vic

bag = sys.argv[1] if len(sys.argv) > 1 else "bags/paper_planar_classical"
print(slip_vic.read_bag(bag).to_string(index=False))

truth = slip_vic.read_bag(bag, "/slip_truth")
time = 1e-9 * (truth.stamp_ns - truth.stamp_ns[0])
speed = np.linalg.norm(truth.filter(regex=r"^velocity").iloc[:, :3], axis=1)
slipping = speed > 1e-3
share, end = float(slipping.mean()), float(time.iloc[-1])
print(f"slips faster than 1 mm/s for {share * end:.2f} of {end:.2f} s, at most {1e3 * speed.max():.0f} mm/s")

commands = slip_vic.read_bag(bag, "/effort_command").filter(regex=r"^effort")
print(commands.abs().max().rename("largest effort [N m]").round(2).to_string())
