"""The bags in `bags/`: whole, small, described, and reproduced by today's controller and simulation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slip_bags.reader import Bag
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.in_process import run_in_process
from slip_vic.run.judge import judge
from slip_vic.run.series import read_series
from slip_vic.run.track import Track
from tools.reference_bags import LARGEST_BYTES, REFERENCES, Reference

BAGS = Path(__file__).parents[3] / "bags"


def test_one_bag_per_reference() -> None:
    assert {path.name for path in BAGS.iterdir()} == {*(reference.name for reference in REFERENCES), "README.md"}


@pytest.mark.parametrize("reference", REFERENCES, ids=lambda reference: reference.name)
def test_reference_bag(reference: Reference) -> None:
    folder = BAGS / reference.name
    assert sum(path.stat().st_size for path in folder.iterdir()) < LARGEST_BYTES
    with Bag(folder) as bag:
        verdict = verify_run(read_run(bag, {}))
    assert verdict.identical, verdict.text()
    rows = (BAGS / "README.md").read_text().splitlines()
    row = next(line for line in rows if line.startswith(f"| `{reference.name}`"))
    assert f"`{reference.command()}`" in row


@pytest.mark.parametrize("reference", REFERENCES, ids=lambda reference: reference.name)
def test_the_simulation_does_what_it_did_when_a_reference_bag_was_recorded(reference: Reference) -> None:
    """What physics, drives and sensors do is noticed too; other processors may round otherwise."""
    scenario = reference.load()
    track = Track(scenario, whole=False)
    judge(run_in_process(scenario), track)
    for now in track.series():
        then = read_series(BAGS / reference.name, now.arm)
        for name in ("slip_displacement", "slip_velocity", "object_position", "object_rotation", "wrench"):
            recorded = getattr(then, name)
            if recorded.size:  # one has no wrench sensor
                np.testing.assert_allclose(getattr(now, name), recorded, rtol=0.0, atol=1e-9, err_msg=name)


def test_a_gain_changed_in_its_last_bit_is_noticed() -> None:
    with Bag(BAGS / "paper_planar_vic") as bag:
        stiffness = read_run(bag, {})[""].params.gains.stiffness
        changed = [float(stiffness[0] * (1.0 + 2.0**-52)), *stiffness[1:]]
        verdict = verify_run(read_run(bag, {"gains.stiffness": changed}))
    assert not verdict.identical
