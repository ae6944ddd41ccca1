"""python examples/retime.py [FOLDER]

Give a taught path the timing that the grasp's friction admits: here the joint positions of a run that loses 40 mm, as
a robot program would have them, a row each 50 ms. The arm's own controller then follows trajectory.csv.
"""

import sys
from pathlib import Path

import slip_vic
from slip_vic.retime.command import run_retime

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/retime")
folder.mkdir(parents=True, exist_ok=True)

run = slip_vic.load("paper_planar", law="classical", set=["bridge.duration_s=2.2"]).run()
print(f"as it was driven: slip {run.slip_mm:.1f} mm")
joints = run.scenario.controller.joint_names
rows = run.frame().iloc[::50]
table = rows[["time_s", *(name for name in rows.columns if name.startswith("q_"))]]
table.set_axis(["time", *joints], axis="columns").to_csv(folder / "taught.csv", index=False)

for line in run_retime(folder / "taught.csv", {"scenario": "paper_planar"}, folder):
    print(line)
