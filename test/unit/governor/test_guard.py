"""The guard in the cycle: when it holds the control acceleration back, and up to which load."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.records import record
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.cycle.contact import held
from slip_vic_controller.cycle.governing import guard
from slip_vic_controller.governor.guard import missing_load
from slip_vic_controller.state import CONFIG, OUTPUTS
from test.support.call import call


@pytest.mark.parametrize("drive", ["ideal", "torque_joint"])
def test_guard_holds_overrun_slide(drive: str) -> None:
    """The law asks for 20 m/s^2 in the slip plane; `off_m` from the reference nothing is measured of 50 N."""
    loop = ClosedLoop(load_scenario("paper_planar", law="governed", drive=drive))  # type: ignore[arg-type]
    for _ in range(700):
        result = loop.control(loop.observe())
        loop.bridge.advance([result.command])
    config, task, state = record(loop.session.controller.config, CONFIG), loop.session.task, loop.controller.state
    outputs = record(result.outputs.copy(), OUTPUTS)
    outputs.law.a_C[:] = 20.0, 0.0, 0.0, 0.0, 0.0, 0.0
    grasped = call(held, config, state, outputs.gains)

    def factor(slips: bool, overrun: bool, off_m: float = 0.0) -> float:
        state.pad.contact.slipping, task.governor.overrun = int(slips), int(overrun)
        state.pad.commanded, state.pad.measured = 50.0, 0.0
        outputs.law.error_linear, outputs.law.error_angular = off_m, 0.0
        return float(call(guard, config, task, state, result.arm, outputs, grasped))

    holds = factor(False, False)
    assert 0.0 < holds < 0.5
    assert factor(False, True) == holds
    assert factor(True, False) == 1.0
    assert factor(True, True) == pytest.approx(holds)
    assert factor(False, True, off_m=0.03) == 1.0, "what is missing of the load is carried by something else"
    assert factor(True, True, off_m=0.03) == factor(True, True), "a slide explains it"


@pytest.mark.parametrize(("linear", "angular", "share"), [
    (0.0, 0.0, 0.0), (0.01, 0.05, 0.0), (0.015, 0.0, 0.5), (0.0, 0.075, 0.5), (1.0, 0.0, 1.0),
])  # fmt: skip
def test_missing_load_counts_far_away(linear: float, angular: float, share: float) -> None:
    cases = (2.0, 1.6, 0.36), (2.0, 1.97, 0.0), (1.6, 2.0, 0.0), (2.0, 2.39, 0.0), (0.5, 3.0, 1.2)
    for commanded, measured, missing in cases:
        found = call(missing_load, commanded, measured, 2.0, linear, angular)
        assert np.isclose(found, missing * share)
