"""The controller's memory as text: a session that goes on from it gives the same efforts to the last bit."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_bags.reader import Bag
from slip_core.errors import InputError
from slip_core.params import build, flatten
from slip_core.records import place
from slip_core.types import EffortCommand
from slip_sim_bridge.session import TickOutputs
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.params.node_params import ControllerNodeParams
from slip_vic_controller.session.manifest import Manifest
from slip_vic_controller.session.snapshot import from_text, to_text
from slip_vic_controller.state import ARM_SIZE, ARM_STATE, TASK_SIZE
from test.support.one_arm import OneArm, one_arm

BAGS = Path(__file__).parents[3] / "bags"
SLIPS_BY = 1100  # tick of paper_planar


@pytest.mark.parametrize(
    "assignments",
    [
        (),
        ("controller.slip_estimator=observer", "controller.gains.spin=bounded"),
        ("controller.attitude=rpy",),
    ],
    ids=["measured", "observer", "rpy"],
)
def test_a_session_goes_on_from_the_text(assignments: tuple[str, ...]) -> None:
    scenario = load_scenario("paper_planar", assignments=assignments)
    loop, restored, outputs, known = ClosedLoop(scenario), None, None, ()
    for tick in range(SLIPS_BY + 150):
        before, outputs = outputs.counts if tick else (), loop.observe()
        if tick == SLIPS_BY - 100:  # a ramp is under way when the text is written
            values = flatten(scenario.controller) | {"object.mass": 1.3 * scenario.controller.object.mass}
            loop.session.retune((build(ControllerNodeParams, values, "test"),))
        if tick == SLIPS_BY:
            known = before
            text = to_text(loop.session.snapshot())
            restored = OneArm(one_arm(scenario.controller, scenario.urdf, lockstep=True))
            restored.restore(from_text(text))
            assert to_text(restored.snapshot()) == text
        expected = loop.control(outputs).command
        if restored is not None:
            assert answer(restored, outputs, known).effort.tobytes() == expected.effort.tobytes()
        loop.bridge.advance([expected])
    assert restored is not None
    # Behind it are the observer's rows, which keep what their last use left in fields that are not in use.
    end = TASK_SIZE + ARM_SIZE
    assert restored.snapshot()[:end].tobytes() == loop.session.snapshot()[:end].tobytes()


def answer(session: OneArm, outputs: TickOutputs, known: tuple[int, ...]) -> EffortCommand:
    """Give a session one tick's samples; known: how many of each input came before it was there."""
    for wrench in outputs.arms[0].wrenches:
        session.add_wrench(0, wrench)
    for slip in outputs.arms[0].slips:
        session.add_slip(0, slip)
    session.add_joint(outputs.arms[0].joint)
    counts = tuple(now - then for now, then in zip(outputs.counts, known, strict=True))
    session.add_manifest(Manifest(outputs.tick, outputs.stamp_ns, counts[0::2], counts[1::2]))
    result = session.cycle()
    assert result is not None
    return result.command


@pytest.mark.parametrize("name", ["paper_planar_vic", "vertical_plane_classical"])
def test_reference_bags_verify_from_the_middle(name: str) -> None:
    with Bag(BAGS / name) as bag:
        runs = read_run(bag, {})
    (run,) = runs.values()
    half = verify_run(runs, from_s=0.5)
    assert half.identical, half.text()
    assert half.cycles < len(run.commands) - 400
    # A bag whose beginning is missing begins where the memory is known.
    late = dataclasses.replace(run, ledger=run.ledger[700:], commands=run.commands[700:], changes=())
    assert verify_run({"": late}).identical


def test_a_state_changed_in_its_last_bit_is_noticed() -> None:
    with Bag(BAGS / "paper_planar_vic") as bag:
        run = read_run(bag, {})[""]
    cycle = min(run.states)
    state = from_text(run.states[cycle])
    at = TASK_SIZE + place(ARM_STATE, "law.posture").start
    state[at] = np.nextafter(state[at], math.inf)
    verdict = verify_run({"": dataclasses.replace(run, states={**run.states, cycle: to_text(state)})}, from_s=0.5)
    assert not verdict.identical


@given(st.text(max_size=80) | st.recursive(st.none() | st.floats() | st.text(), st.lists, max_leaves=8).map(json.dumps))
def test_other_texts_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="controller state"):
        from_text(text)
