"""Every topic and field in the layout for Foxglove is in a recorded run."""

import json
import re
from functools import lru_cache
from pathlib import Path

from slip_bags.reader import Bag
from slip_bags.series import Series
from slip_core.topics import TOPICS
from slip_vic_controller.law.symbols import published
from slip_vic_controller.state import GOVERNED

ROOT = Path(__file__).parents[3]
PANELS = json.loads((ROOT / "config" / "foxglove.json").read_text())["configById"].values()
PATHS = [path for panel in PANELS for path in panel.get("paths", [])]
GOVERNOR_S = frozenset(GOVERNED.names or ())
"""Numbers that a run without the governor does not have: `test_numbers_of_the_controller_are_at_their_places`."""


@lru_cache
def series_of(topic: str) -> Series:
    bag = Bag(ROOT / "bags" / "paper_planar_vic")
    return bag.series(topic)


def is_recorded(path: str) -> bool:
    """Whether the bag has `/topic.field.field`, with `[number]` behind an array."""
    topic, _, rest = path.partition(".")
    field, _, number = rest.rstrip("]").partition("[")
    if topic.strip("/") not in TOPICS or field not in series_of(topic):
        return False
    return not number or int(number) < series_of(topic)[field].shape[1]


def test_every_curve_is_recorded() -> None:
    assert len(PATHS) > 10
    assert [p for p in PATHS if not (is_recorded(p["value"]) or p.get("label") in GOVERNOR_S)] == []
    assert not is_recorded("/slip_truth.position[6]")
    assert not is_recorded("/slip_truth.positions[0]")


def test_every_topic_is_ours() -> None:
    topics = [name for panel in PANELS for name in panel.get("topics", {})]
    topics += [layer["topic"] for panel in PANELS for layer in panel.get("layers", {}).values() if "topic" in layer]
    assert "/object_description" in topics
    assert [name for name in topics if name.removeprefix("/") not in TOPICS] == []


def test_numbers_of_the_controller_are_at_their_places() -> None:
    """Foxglove knows them by their place, which is that of an arm with seven joints."""
    names = [*published(7)[0], *(GOVERNED.names or ()), "mode", "path_speed"]
    found = [path for path in PATHS if path["value"].startswith("/controller/scalars")]
    assert len(found) > 5
    for path in found:
        place = re.search(r"\[(\d+)\]", path["value"])
        assert place is not None
        assert names[int(place[1])] == path["label"]
