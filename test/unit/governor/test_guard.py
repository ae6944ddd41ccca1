"""The guard in the cycle: when it holds the control acceleration back, and up to which load."""

from __future__ import annotations

import pytest

from slip_core.records import record
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.cycle.contact import held
from slip_vic_controller.cycle.governing import guard
from slip_vic_controller.state import CONFIG, OUTPUTS
from test.support.call import call


@pytest.mark.parametrize("drive", ["ideal", "torque_joint"])
def test_guard_holds_overrun_slide(drive: str) -> None:
    """The law asks for 20 m/s^2 in the slip plane."""
    loop = ClosedLoop(load_scenario("paper_planar", law="governed", drive=drive))  # type: ignore[arg-type]
    for _ in range(700):
        result = loop.control(loop.observe())
        loop.bridge.advance([result.command])
    config, task, state = record(loop.session.controller.config, CONFIG), loop.session.task, loop.controller.state
    outputs = record(result.outputs.copy(), OUTPUTS)
    outputs.law.a_C[:] = 20.0, 0.0, 0.0, 0.0, 0.0, 0.0
    grasped = call(held, config, state, outputs.gains)

    def factor(slips: bool, overrun: bool) -> float:
        state.pad.contact.slipping, task.governor.overrun = int(slips), int(overrun)
        return float(call(guard, config, task, state, result.arm, outputs, grasped))

    holds = factor(False, False)
    assert 0.0 < holds < 0.5
    assert factor(False, True) == holds
    assert factor(True, False) == 1.0
    assert factor(True, True) == pytest.approx(holds)
