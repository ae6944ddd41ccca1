"""The bags in `bags/`: whole, small, described, and reproduced to the last bit by today's controller."""

from __future__ import annotations

from pathlib import Path

import pytest

from slip_bags.reader import Bag
from slip_vic.replay.references import LARGEST_BYTES, SEED, reference_names
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run

BAGS = Path(__file__).parents[3] / "bags"
NAMES = [name for _, _, name in reference_names()]


def test_one_bag_per_scenario_and_controller() -> None:
    assert {path.name for path in BAGS.iterdir()} == {*NAMES, "README.md"}


@pytest.mark.parametrize(("scenario", "controller", "name"), list(reference_names()))
def test_reference_bag(scenario: str, controller: str, name: str) -> None:
    assert sum(path.stat().st_size for path in (BAGS / name).iterdir()) < LARGEST_BYTES
    with Bag(BAGS / name) as bag:
        run = read_run(bag, {})
        verdict = verify_run(run)
    assert verdict.identical, verdict.text()
    assert run[""].params.controller == controller
    row = next(line for line in (BAGS / "README.md").read_text().splitlines() if line.startswith(f"| `{name}`"))
    assert f"slip-vic run --scenario {scenario} --law {controller} --seed {SEED}" in row


def test_a_gain_changed_in_its_last_bit_is_noticed() -> None:
    with Bag(BAGS / "paper_planar_vic") as bag:
        stiffness = read_run(bag, {})[""].params.gains.stiffness
        changed = [float(stiffness[0] * (1.0 + 2.0**-52)), *stiffness[1:]]
        verdict = verify_run(read_run(bag, {"gains.stiffness": changed}))
    assert not verdict.identical
