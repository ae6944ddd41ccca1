"""The controller's memory as text: a session that goes on from it gives the same efforts to the last bit."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_bags.reader import Bag
from slip_bringup.inprocess import ClosedLoop
from slip_bringup.replay.references import reference_names
from slip_bringup.replay.run_data import read_run
from slip_bringup.replay.verify import verify_run
from slip_bringup.scenario import load_scenario
from slip_core.errors import InputError
from slip_core.params import build, flatten
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.session import ControllerSession
from slip_vic_controller.core.snapshot import from_text, to_text
from slip_vic_controller.node_params import ControllerNodeParams

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
    loop, other = ClosedLoop(scenario), None
    for tick in range(SLIPS_BY + 150):
        outputs = loop.observe()
        if tick == SLIPS_BY - 100:  # a ramp is under way when the text is written
            values = flatten(scenario.controller) | {"object.mass": 1.3 * scenario.controller.object.mass}
            loop.controller.retune(build(ControllerNodeParams, values, "test"))
        if tick == SLIPS_BY:
            other = True
            text = to_text(loop.controller.snapshot())
            restored = ControllerSession(VicController(scenario.controller, scenario.urdf), lockstep=True)
            restored.restore(from_text(text))
            restored.inputs = loop.controller.inputs
            assert to_text(restored.snapshot()) == text
        if other is None:
            loop.bridge.advance(loop.control(outputs).command)
            continue
        expected, found = both(loop, restored, outputs)
        assert found.effort.tobytes() == expected.effort.tobytes()
        loop.bridge.advance(expected)


def both(loop: ClosedLoop, restored: ControllerSession, outputs):
    """Give one tick's inputs to both sessions, by way of the same buffer."""
    health = []
    original = loop.controller.inputs.take

    def keep():
        health.append(original())
        return health[0]

    loop.controller.inputs.take = keep
    result = loop.control(outputs)
    loop.controller.inputs.take = original
    inputs = health[0]
    restored.monitor.joint.judge(inputs.joint, inputs.joint.stamp_ns)
    from slip_vic_controller.core.input_monitor import Health
    from slip_vic_controller.core.modes import Request

    done = restored.supervisor.step(
        restored.safety, restored.state, inputs.joint.stamp_ns, inputs.joint, inputs.wrenches, inputs.slips,
        Health.from_code(result.decision[3]), restored.monitor.joint.frozen(inputs.joint.stamp_ns), Request.NONE, None,
        inputs.new_slips[0],
    )  # fmt: skip
    restored.state, restored.safety = done.control, done.state
    return result.command, done.command


@pytest.mark.parametrize("name", [name for _, _, name in reference_names()])
def test_reference_bags_verify_from_the_middle(name: str) -> None:
    with Bag(BAGS / name) as bag:
        run = read_run(bag, {})
    whole, half = verify_run(run), verify_run(run, from_s=0.5)
    assert half.identical, half.text()
    assert half.cycles < whole.cycles - 400
    # A bag whose beginning is missing begins where the memory is known.
    late = dataclasses.replace(run, ledger=run.ledger[700:], efforts=run.efforts[700:], changes=())
    assert verify_run(late).identical


def test_a_memory_changed_in_its_last_bit_is_noticed() -> None:
    with Bag(BAGS / "paper_planar_vic") as bag:
        run = read_run(bag, {})
    cycle = min(run.states)
    cycles, control, *rest = from_text(run.states[cycle])
    memory = control.memory.copy()
    memory[3] = np.nextafter(memory[3], 1.0)
    changed = to_text((cycles, control._replace(memory=memory), *rest))
    verdict = verify_run(dataclasses.replace(run, states={**run.states, cycle: changed}), from_s=0.5)
    assert not verdict.identical


@given(st.text(max_size=80) | st.recursive(st.none() | st.floats() | st.text(), st.lists, max_leaves=8).map(str))
def test_other_texts_are_refused_or_plain(text: str) -> None:
    try:
        value = from_text(text)
    except InputError:
        return
    assert value is None or isinstance(value, bool | int | float | str | tuple)
