"""What the arm does when efforts reach its drives late: prints the table of docs/safety.md."""

from __future__ import annotations

from typing import Any

import numpy as np

from slip_campaigns.faults import trial as trials
from slip_campaigns.faults.channel import Channel
from slip_campaigns.faults.dds_campaign import campaign_scenario
from slip_campaigns.faults.plan import EFFORT, Fault, Plan
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.session import Controller, CycleResult

FROM_S, LASTS_S = 0.8, 6.0
LAGS_MS = (8, 12, 16, 20, 24)


class Late(Channel):
    """Hands everything on, later by the fault's size [s]."""

    def _suffer(self, fault: Fault, sample: Any, now_ns: int, measured_ns: int) -> None:
        self._put(sample, now_ns + round(1e9 * fault.size), measured_ns, True)


class Watched(trials.Trial):
    """A trial that notes time, mode and fastest joint [rad/s] of every answer while the object is held."""

    def __init__(self, plan: Plan) -> None:
        super().__init__(plan)
        self.seen: list[tuple[float, Mode, float, str]] = []

    def _answer(self, result: CycleResult | None, t: float) -> None:
        if result is not None and not self._lost:
            speed = float(np.abs(result.joint.velocity).max())
            self.seen.append((t, result.mode, speed, result.reason))
        super()._answer(result, t)


def main() -> None:
    """Print a row for each lag."""
    scenario = campaign_scenario()
    law = Controller(scenario.controller, scenario.urdf, lockstep=False)
    vars(trials).update(Channel=Late, DURATION_S=LASTS_S, prepared=lambda *_: (scenario, law))
    print("| efforts late by | FAULT | fastest joint before, after | object lost |\n|---|---|---|---|")
    for lag_ms in LAGS_MS:
        fault = Fault("late", EFFORT, FROM_S, LASTS_S, 1e-3 * lag_ms)
        trial = Watched(Plan(0, 1, "paper_planar", True, "vic", (fault,)))
        outcome = trial.run()
        assert not outcome.violations, outcome.violations
        before = [row for row in trial.seen if row[1] != Mode.FAULT]
        after = [row for row in trial.seen if row[1] == Mode.FAULT]
        told = f"after {after[0][0] - FROM_S:.2f} s: {after[0][3]}" if after else "none"
        speeds = f"{max(row[2] for row in before):.1f}, {max((row[2] for row in after), default=0.0):.1f} rad/s"
        lost = f"{trial.seen[-1][0] - after[0][0]:.2f} s after FAULT" if after and outcome.objects_lost else "no"
        print(f"| {lag_ms} ms | {told} | {speeds} | {lost} |")


if __name__ == "__main__":
    main()
