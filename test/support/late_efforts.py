"""What the arm does when efforts reach its drives late: prints the tables of docs/results.md."""

from __future__ import annotations

import itertools
import sys
from typing import Any
from unittest import mock

from slip_vic.scenarios import scenario_names
from slip_vic.scenarios.scenario import Law, Scenario
from test.campaigns.faults import trial as trials
from test.campaigns.faults.channel import Channel
from test.campaigns.faults.dds_campaign import campaign_scenario
from test.campaigns.faults.plan import EFFORT, IDEAL, Fault, Plan
from test.support.one_arm import one_arm

FROM_S, LASTS_S = 0.8, 6.0
LAGS_MS = (8, 12, 16, 20, 24)
SETTINGS: tuple[tuple[Law, str], ...] = (
    ("vic", IDEAL), ("vic", "optical_flow_120"), ("governed", IDEAL), ("governed", "vision_60"), ("classical", IDEAL),
)  # fmt: skip


class Late(Channel):
    """Hands everything on, later by the fault's size [s]."""

    def _suffer(self, fault: Fault, sample: Any, now_ns: int, measured_ns: int) -> None:
        self._put(sample, now_ns + round(1e9 * fault.size), measured_ns, True)


def fate(plan: Plan, scenario: Scenario, told_s: float) -> str:
    """Return what becomes of law, arm and object; told_s: how late the controller knows its drives to be [s]."""
    drive = scenario.controller.drive.model_copy(update={"delay_s": told_s})
    law = one_arm(scenario.controller.model_copy(update={"drive": drive}), scenario.urdf, lockstep=False)
    with mock.patch.multiple(trials, Channel=Late, DURATION_S=LASTS_S, prepared=lambda *_: (scenario, law)):
        outcome = trials.run_trial(plan)
    if outcome.violations:
        return "swings"
    return "lost" if outcome.objects_lost else "FAULT, held" if outcome.modes["FAULT"] else "law at work"


def main() -> None:
    """Print a row for each setting; --told: the controller knows how late its efforts are, all the time."""
    told = "--told" in sys.argv
    print("|".join(("", " setting ", *(f" {lag_ms} ms " for lag_ms in LAGS_MS), "")))
    print("|---" * (1 + len(LAGS_MS)) + "|")
    for name, (kind, sensor) in itertools.product(scenario_names(1), SETTINGS):
        cells = []
        for lag_ms in LAGS_MS:
            late = Fault("late", EFFORT, 0.0 if told else FROM_S, LASTS_S, 1e-3 * lag_ms)
            plan = Plan(0, 1, name, kind != "classical", kind, (late,), sensor)
            cells.append(f" {fate(plan, campaign_scenario(plan), 1e-3 * lag_ms if told else 0.0)} ")
        print("|".join(("", f" {plan.setting} ", *cells, "")), flush=True)


if __name__ == "__main__":
    main()
