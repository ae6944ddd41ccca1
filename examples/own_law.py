"""python examples/own_law.py

A control law of your own beside classical impedance control: here one that stops following the path while the object
slips. Every tick gives what the sensors measured and the arm's terms; you set the effort.
"""

import numpy as np

import slip_vic

K, D = np.diag([400.0] * 3 + [40.0] * 3), np.diag([40.0] * 3 + [4.0] * 3)


def own_law(tick: slip_vic.Tick) -> np.ndarray:
    """Return the effort (7,) [N m]: a spring to the path at the pad, softer the faster the object slips."""
    arm, reference, slips = tick.result.arm, tick.result.record.reference, tick.outputs.arms[0].slips
    J = np.array(arm.J[:, :7])
    error = np.array(reference.position - arm.position)
    turn = 0.5 * sum(np.cross(arm.rotation[:, k], reference.rotation[:, k]) for k in range(3))
    slip = slips[-1].twist if slips else np.zeros(6)
    soft = 1.0 / (1.0 + 50.0 * float(np.linalg.norm(slip[:3])))
    force = soft * K @ np.concatenate((error, turn)) + D @ (np.array(reference.twist) - np.array(arm.twist))
    return J.T @ force + arm.bias[:7]


scenario = slip_vic.load("paper_planar", law="classical", set=["bridge.duration_s=2.5"])
for name, run in {"classical": scenario.run(), "own": scenario.run(law=own_law)}.items():
    print(f"{name:10} {run.outcome}: slip {run.slip_mm:.2f} mm, {run.slip_deg:.2f} deg, {run.reason}")

# The same loop by hand, where you need more of it than the effort:
largest = 0.0
for tick in scenario.ticks():
    tick.effort = own_law(tick)
    largest = max(largest, float(np.abs(tick.effort).max()))
print(f"largest effort of the own law: {largest:.1f} N m")
