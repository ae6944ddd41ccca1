"""python examples/own_sensor.py [FOLDER]

Your slip sensor in numbers: write its data sheet as a YAML file, see what the law does with it. The same file works on
the command line: slip-vic check --sensor my_sensor.yaml
"""

import sys
from pathlib import Path

import slip_vic

SENSOR = """\
description: A camera behind a gel pad, 90 pictures a second.
sources: the data sheet, and an hour with a linear stage
slip:
  rate_hz: 90.0
  latency_s: 0.012
  noise_linear: 2.0e-4 # m/s
  noise_angular: 4.0e-3 # rad/s
  dead_band_linear: 5.0e-4 # m/s
controller:
  slip_estimator: observer # a sensor this late cannot be followed directly
"""

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
folder.mkdir(parents=True, exist_ok=True)
file = folder / "my_sensor.yaml"
file.write_text(SENSOR, encoding="utf-8")

for sensor in ("ideal", str(file), "vision_25"):
    run = slip_vic.load("paper_planar", law="vic", sensor=sensor, seed=1, set=["bridge.duration_s=2.5"]).run()
    peak = run.frame().slip_linear_mm.max()
    print(f"{Path(sensor).stem:12} {run.outcome}: slip {run.slip_mm:.2f} mm at the end, {peak:.2f} mm at most")
