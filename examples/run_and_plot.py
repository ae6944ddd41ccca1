"""python examples/run_and_plot.py [SCENARIO] [FOLDER]

Three laws on one task: how much the object slips, and the page with the 3D replay of each.
"""

import sys
from pathlib import Path

import slip_vic

scenario = sys.argv[1] if len(sys.argv) > 1 else "paper_planar"
folder = Path(sys.argv[2] if len(sys.argv) > 2 else "out/examples")
folder.mkdir(parents=True, exist_ok=True)

for law in ("classical", "vic", "governed"):
    run = slip_vic.load(scenario, law=law, set=["bridge.duration_s=2.5"]).run()
    slip = f"slip {run.slip_mm:.2f} mm, {run.slip_deg:.2f} deg"
    print(f"{law:10} {run.outcome}: {slip}; arrives after {run.arrival_s:.2f} s")
    print("           ", run.page(folder / f"{law}.html"))
