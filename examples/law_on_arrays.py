"""python examples/law_on_arrays.py

The paper's law once, as the cycle calls it: what it answers to more and more slip. No simulator, no ROS, no parameter
files. Records are numbers by name; what stands here for one contact and six joints are all that the law reads.
"""

import numpy as np

from slip_core.records import new, record
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.config import LAW_CONFIG
from slip_vic_controller.law.law import evaluate
from slip_vic_controller.state import OUTPUTS

JOINTS = 6
config, arm, cycle = (record(new(kind), kind) for kind in (LAW_CONFIG, ARM, OUTPUTS))
config.joints, config.contacts, config.radius, config.effort_limit[:JOINTS] = JOINTS, 1, 1.0, np.inf
contact = config.contact[0]
contact.position[:], contact.rotation[:], contact.slip_axes[:] = [0.02, 0.0, 0.0], np.eye(3), 1.0

arm.rotation[:], arm.J[:, :JOINTS], arm.M[:JOINTS, :JOINTS] = np.eye(3), np.eye(6), np.eye(6)
cycle.reference.position[:], cycle.reference.rotation[:] = [0.01, 0.0, 0.0], np.eye(3)
for slip in cycle.slips:
    slip.rotation[:] = np.eye(3)

gains, body = cycle.gains.gains, cycle.gains.object
gains.K_D[:], gains.D_D[:], gains.M_D[:] = [400.0] * 3 + [4.5] * 3, [25.0] * 3 + [2.2] * 3, [0.4] * 3 + [0.3] * 3
gains.gamma_k[:], gains.gamma_d[:], gains.alpha, gains.k_s = 100.0, 100.0, 100.0, 100.0
gains.characteristic_length, gains.spin_limit = 1.0, np.inf
body.mass, body.inertia[:], cycle.gains.contact_position[:] = 0.5, 2e-3 * np.eye(3), contact.position

q = qd = np.zeros(JOINTS)
print("slip [mm/s]   stiffness [N/m]   gate   force along x [N]")
for speed in (0.0, 0.001, 0.003, 0.01, 0.03):
    cycle.samples[0].wrench[:] = [0.3, 0.0, 0.0, 0.0, 0.0, 0.0]
    cycle.samples[0].slip_twist[:] = [speed, 0.0, 0.0, 0.0, 0.0, 0.0]
    evaluate(config, arm, q, qd, q, np.zeros(3), cycle)
    law = cycle.law
    print(f"{1e3 * speed:11.0f} {law.K[0]:17.1f} {law.gate:6.2f} {law.effort[0]:19.2f}")
