"""Channels of a recorded run."""

from pathlib import Path

import numpy as np

from slip_bags.reader import Bag
from slip_bags.writer import BagWriter
from slip_vic.run.data import read_data

RECORDED = Path(__file__).parents[3] / "bags" / "paper_planar_vic"


def test_missed_messages_leave_the_others(tmp_path: Path) -> None:
    whole = read_data(RECORDED)
    missed = {"/slip_truth": (700,), "/object_state": (300, 301), "/effort_command": (5,), "/controller/scalars": (9,)}
    with Bag(RECORDED) as bag:
        writer = BagWriter(tmp_path / "bag")
        for info in bag.topics.values():
            writer.add_topic(info, bag._schema(info).data.decode())
        seen = dict.fromkeys(bag.topics, -1)
        for message in bag.raw():
            seen[message.topic] += 1
            if seen[message.topic] not in missed.get(message.topic, ()):
                writer.write(*message)
        writer.close()
    cut = read_data(tmp_path / "bag")
    before, after = whole.arm("").channel("slip"), cut.arm("").channel("slip")
    assert np.array_equal(after.times, np.delete(before.times, 700))
    assert np.array_equal(after.rows, np.delete(before.rows, 700, axis=0))
    assert np.array_equal(cut.object_pose.rows, np.delete(whole.object_pose.rows, (300, 301), axis=0))
    assert len(cut.arm("").channel("effort").rows) == len(whole.arm("").channel("effort").rows) - 1
