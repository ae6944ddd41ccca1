"""python examples/own_arm.py [ARM.urdf] [FOLDER]

A folder that runs from the URDF of an arm with at least six joints: what `slip-vic arm` does, from Python. Without a
file it takes the arm of the scenarios.
"""

import sys
from pathlib import Path

import slip_vic
from slip_description import urdf_text
from slip_vic.setup.arm.write import Arm, write_arm

file = Path(sys.argv[1]) if len(sys.argv) > 1 else None
folder = Path(sys.argv[2] if len(sys.argv) > 2 else "out/examples/arm")

arm = Arm(file.read_text(encoding="utf-8")) if file else Arm(urdf_text(), link="ee", approach="x", normal="z")
task, start, assumed = arm.task("paper_planar", 0.5)
for line in (*arm.said, *assumed):
    print(line)
print(f"start: {start.posture.round(2)}, at least {start.way.margin.min():.2f} rad away from every limit on the way")
for path in write_arm(arm, {"paper_planar": task}, folder, file or Path("arm.urdf")):
    print(path)

run = slip_vic.load(folder / "paper_planar.yaml", law="governed", set=["bridge.duration_s=2.0"]).run()
print(f"governed: {run.outcome}, slip {run.slip_mm:.2f} mm, goal error {run.final_error_mm:.2f} mm")
