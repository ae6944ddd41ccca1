"""python examples/two_arms.py

A glass pane between two arms, and what each law makes of bases that stand 2 mm and 0.3 degrees off: the force with
which the arms pull at each other through the pane.
"""

import slip_vic

OFF = ["right.bridge.base.position=[0.002, -0.515, 0.0]", "right.bridge.base.rotation=[0.0, 0.0, 0.717]"]

for law in ("classical", "vic", "governed"):
    run = slip_vic.load("pane_two_arms_upright", law=law, set=OFF).run()
    internal = f"internal force {run.internal_force_n:6.2f} N"
    print(f"{law:10} {run.outcome:6} slip {run.slip_mm:6.2f} mm, {internal}  {run.reason}")
