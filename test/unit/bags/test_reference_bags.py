"""The bags in `bags/`: whole, small, described, and reproduced to the last bit by today's controller."""

from __future__ import annotations

from pathlib import Path

import pytest

from slip_bags.reader import Bag
from slip_core.records import place
from slip_vic.replay.references import LARGEST_BYTES, Reference, references
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic_controller.snapshot import from_text, to_text
from slip_vic_controller.state import ARM_STATE, TASK_SIZE

BAGS = Path(__file__).parents[3] / "bags"
REFERENCES = references()


def test_one_bag_per_reference() -> None:
    assert {path.name for path in BAGS.iterdir()} == {*(reference.name for reference in REFERENCES), "README.md"}


@pytest.mark.parametrize("reference", REFERENCES, ids=lambda reference: reference.name)
def test_reference_bag(reference: Reference) -> None:
    folder = BAGS / reference.name
    assert sum(path.stat().st_size for path in folder.iterdir()) < LARGEST_BYTES
    with Bag(folder) as bag:
        runs = read_run(bag, {})
        verdict = verify_run(runs)
    assert verdict.identical, verdict.text()
    assert all(run.states for run in runs.values())  # what the commands do not show is compared, too
    rows = (BAGS / "README.md").read_text().splitlines()
    row = next(line for line in rows if line.startswith(f"| `{reference.name}`"))
    assert f"`{reference.command()}`" in row


def test_a_gain_changed_in_its_last_bit_is_noticed() -> None:
    with Bag(BAGS / "paper_planar_vic") as bag:
        stiffness = read_run(bag, {})[""].params.gains.stiffness
        changed = [float(stiffness[0] * (1.0 + 2.0**-52)), *stiffness[1:]]
        verdict = verify_run(read_run(bag, {"gains.stiffness": changed}))
    assert not verdict.identical


@pytest.mark.parametrize("name", ["paper_planar_vic", "vic_bad_sensor"])
def test_a_state_of_another_size_is_no_error(name: str) -> None:
    with Bag(BAGS / name) as bag:
        known = read_run(bag, {})[""].params.slip_estimator
        other = "measured" if known == "observer" else "observer"
        verdict = verify_run(read_run(bag, {"slip_estimator": other}))
    assert not verdict.identical
    assert verdict.first is not None


def test_a_number_of_the_state_that_is_not_as_recorded_is_named() -> None:
    with Bag(BAGS / "paper_planar_vic") as bag:
        runs = read_run(bag, {})
    states = runs[""].states
    first = min(states)
    state = from_text(states[first])
    state[TASK_SIZE + place(ARM_STATE, "law.e_previous").start + 1] *= 1.0 + 2.0**-52
    states[first] = to_text(state)
    verdict = verify_run(runs)
    assert verdict.different == 1
    assert verdict.first is not None
    assert (verdict.first.cycle, verdict.first.field) == (first, "arm.law.e_previous[1]")
    assert f"cycle {first} " in verdict.text()
    assert "controller/state" in verdict.text()
