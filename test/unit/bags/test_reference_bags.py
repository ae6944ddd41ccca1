"""The bags in `bags/`: whole, small, described, and reproduced by today's controller and simulation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_vic.page.runs import newest_on_grid
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.data import read_data
from slip_vic.run.in_process import run_in_process
from slip_vic.run.judge import judge
from tools.reference_bags import LARGEST_BYTES, REFERENCES, Reference

BAGS = Path(__file__).parents[3] / "bags"


def test_one_bag_per_reference() -> None:
    assert {path.name for path in BAGS.iterdir()} == {*(reference.name for reference in REFERENCES), "README.md"}


@pytest.mark.parametrize("reference", REFERENCES, ids=lambda reference: reference.name)
def test_a_replay_gives_the_same_commands(reference: Reference) -> None:
    folder = BAGS / reference.name
    assert sum(path.stat().st_size for path in folder.iterdir()) < LARGEST_BYTES
    bag = Bag(folder)
    verdict = verify_run(read_run(bag))
    assert verdict.identical, verdict.text()
    rows = (BAGS / "README.md").read_text().splitlines()
    row = next(line for line in rows if line.startswith(f"| `{reference.name}`"))
    assert f"`{reference.command()}`" in row


@pytest.mark.parametrize("reference", REFERENCES, ids=lambda reference: reference.name)
def test_the_simulation_does_what_it_did_when_a_reference_bag_was_recorded(reference: Reference) -> None:
    """What physics, drives and sensors do is noticed too; other processors may round otherwise."""
    scenario = reference.load()
    made, recorded = judge(run_in_process(scenario), scenario).data, read_data(BAGS / reference.name)
    pairs = []
    for now in made.arms:
        then = recorded.arm(now.name)
        pairs += [
            (now.channel(name), then.channel(name), name)
            for name in ("slip", "slip_velocity", "wrench")
            if name in then.channels  # one has no wrench sensor
        ]
    for now, then, name in pairs:
        np.testing.assert_allclose(now.rows, newest_on_grid(then, now.times), rtol=0.0, atol=1e-9, err_msg=name)
    pose, bag_pose = made.object_pose.rows, newest_on_grid(recorded.object_pose, made.object_pose.times)
    np.testing.assert_allclose(pose[:, :3], bag_pose[:, :3], rtol=0.0, atol=1e-9)
    turns = [Rotation.from_quat(rows[:, 3:]).as_matrix() for rows in (pose, bag_pose)]
    np.testing.assert_allclose(*turns, rtol=0.0, atol=1e-9)
