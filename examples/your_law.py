"""python examples/your_law.py

A control law of your own: a spring to the path that grips harder while it slips. See docs/your_law.md."""

import numpy as np

import slip_vic


class YourLaw:
    """A spring and a damper."""

    needs = frozenset({"slip", "grip"})

    def reset(self, setup: slip_vic.Setup) -> None:  # noqa: D102
        self.setup, self.grip = setup, setup.grip

    def step(self, seen: slip_vic.Seen) -> slip_vic.Pad:  # noqa: D102
        wanted = self.setup.reference(seen.time)
        error = seen.way_to(wanted)
        self.grip = max(self.grip, self.setup.grip + 20.0 * float(np.linalg.norm(seen.slip[:3])))
        return slip_vic.Pad(wanted.acceleration + 100.0 * error + 20.0 * (wanted.twist - seen.twist), self.grip)


if __name__ == "__main__":
    scenario = slip_vic.load("paper_planar", law="classical", set=["bridge.duration_s=2.5"])
    for name, run in {"classical": scenario.run(), "yours": scenario.run(law=YourLaw())}.items():
        print(f"{name:10} {run.outcome}: slip {run.slip_mm:.2f} mm {run.reason}")
