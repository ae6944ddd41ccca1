"""Series of a run, as the report shows them."""

from pathlib import Path

import numpy as np

from slip_bags.reader import Bag
from slip_bags.writer import BagWriter
from slip_vic.run.series import read_series

RECORDED = Path(__file__).parents[3] / "bags" / "paper_planar_vic"


def test_messages_that_a_recorder_missed_leave_series_of_one_length(tmp_path: Path) -> None:
    whole = read_series(RECORDED)
    missed = {"/slip_truth": (700,), "/object_state": (300, 301), "/effort_command": (5,), "/controller/scalars": (9,)}
    with Bag(RECORDED) as bag:
        writer = BagWriter(tmp_path / "bag")
        for info in bag.topics.values():
            writer.add_topic(info, bag.schema_text(info.name))
        seen = dict.fromkeys(bag.topics, -1)
        for message in bag.raw():
            seen[message.topic] += 1
            if seen[message.topic] not in missed.get(message.topic, ()):
                writer.write(*message)
        writer.close()
    cut = read_series(tmp_path / "bag")
    kept = np.setdiff1d(np.arange(len(whole.time)), (300, 301, 700))
    assert np.array_equal(cut.time, whole.time[kept])
    assert np.array_equal(cut.slip_displacement, whole.slip_displacement[kept])
    assert np.array_equal(cut.object_position, whole.object_position[kept])
