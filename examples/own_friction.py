"""python examples/own_friction.py

The same motion on your own friction: coefficients, the size of the pad, how friction falls with speed. The governor is
configured with what the scenario has; `bridge.` changes the world alone, behind the controller's back.
"""

import slip_vic

FRICTION = {
    "as the scenario has it": [],
    "wet": ["bridge.friction.mu_s=0.42", "bridge.friction.mu_k=0.25", "bridge.friction.stribeck_velocity=0.01"],
    "LuGre": ["bridge.friction.model=lugre"],
    "small pad": ["bridge.friction.torsional_radius=0.01"],
}

print(f"{'friction':24} {'classical':>12} {'vic':>12} {'governed':>12}   slip at the end [mm]")
for name, world in FRICTION.items():
    slips = []
    for law in ("classical", "vic", "governed"):
        run = slip_vic.load("paper_planar", law=law, set=[*world, "bridge.duration_s=2.2"]).run()
        slips.append(f"{run.slip_mm:12.2f}" if run.outcome == "ok" else f"{run.outcome:>12}")
    print(f"{name:24}", *slips)
