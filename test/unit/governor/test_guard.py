"""The guard in the cycle: when it holds the control acceleration back, and up to which load."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.records import record
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load
from slip_vic_controller.cycle.governing import guard
from slip_vic_controller.cycle.sensing import held
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.state import CONFIG, INPUTS, OUTPUTS, ArmCycle
from test.support.call import call


@pytest.mark.parametrize("drive", ["ideal", "torque_joint"])
def test_guard_holds_overrun_slide(drive: str) -> None:
    """The law asks for 20 m/s^2 in the slip plane."""
    loop = ClosedLoop(load("paper_planar", law="governed", drive=drive))  # type: ignore[arg-type]
    for _ in range(700):
        result = loop.answer(loop.bridge.observe())[0]
        loop.bridge.advance([result.command])
    config, task, state = record(loop.session.controller.config, CONFIG), loop.session.task, loop.session.arms[0].state
    inputs, outputs = record(result.inputs, INPUTS), record(result.outputs.copy(), OUTPUTS)
    outputs.law.a_C[:] = 20.0, 0.0, 0.0, 0.0, 0.0, 0.0
    grasped = call(held, config, state, outputs.gains)

    def factor(slips: bool, overrun: bool, added: float = 0.0) -> float:
        state.pad.evidence.added[0] = added
        state.pad.contact.slipping, task.governor.overrun = int(slips), int(overrun)
        return float(call(guard, ArmCycle(config, task, state, inputs, outputs, True), grasped))

    holds = factor(False, False)
    assert 0.0 < holds < 0.5
    assert factor(False, True) == holds
    assert factor(True, False) == 1.0
    assert factor(True, True) == pytest.approx(holds)
    # What drives add against the command is not drawn: up to F^ of it the law may ask for more, with it for less.
    ceiling = task.governor.ceiling
    less, more = (1.5, 0.5) if drive == "torque_joint" else (1.0, 1.0)  # exact drives add nothing
    assert factor(False, False, -0.5 * ceiling) == pytest.approx(less * holds, rel=0.02)
    assert factor(False, False, 0.5 * ceiling) == pytest.approx(more * holds, rel=0.02)


def test_how_a_pad_comes_to_rest_in_hold_is_no_load() -> None:
    loop, largest = ClosedLoop(load("paper_planar", law="governed", drive="torque_joint")), 0.0
    state = loop.session.arms[0].state
    for k in range(1100):
        state.outside = int(Reason.SECOND_PUBLISHER) if 700 <= k < 702 else 0
        loop.bridge.advance([loop.answer(loop.bridge.observe())[0].command])
        largest = max(largest, float(np.abs(state.pad.evidence.needed).max()))
    assert largest < 0.4
