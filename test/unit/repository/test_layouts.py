"""Every topic and field in the viewer layouts is in a recorded run."""

import json
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import pytest

from slip_bags.reader import Bag
from slip_bags.series import Series
from slip_core.topics import TOPICS
from slip_vic.run.commands import recorded_topics
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.law.symbols import published
from slip_vic_controller.state import GOVERNED

ROOT = Path(__file__).parents[3]
LAYOUTS = ROOT / "config" / "layouts"
GOVERNOR_S = frozenset(GOVERNED.names or ())
"""Numbers that a run without the governor does not have: `test_named_numbers_of_the_controller_are_there`."""


@pytest.fixture(scope="module")
def bag() -> Iterator[Bag]:
    with Bag(ROOT / "bags" / "paper_planar_vic") as opened:
        yield opened


@lru_cache
def series_of(bag: Bag, topic: str) -> Series:
    return bag.series(topic)


def topic_of(bag: Bag, path: str) -> str:
    """Return the longest topic of the bag that a path begins with, "" where there is none."""
    return max((name for name in bag.topics if re.match(rf"{re.escape(name)}[/.\[]", path)), key=len, default="")


def plotjuggler_has(bag: Bag, curve: str) -> bool:
    """Whether the bag has `/topic/field/field`, or `/topic/joint/field` of a joint state."""
    topic = topic_of(bag, curve)
    if not topic:
        return False
    rest, series = curve[len(topic) + 1 :], series_of(bag, topic)
    name, _, field = rest.partition("/")
    return rest.replace("/", ".") in series or ("name" in series and name in series["name"][0] and field in series)


def foxglove_has(bag: Bag, path: str) -> bool:
    """Whether the bag has `/topic.field.field`, with `[number]` behind an array."""
    topic = topic_of(bag, path)
    field, _, number = path[len(topic) + 1 :].rstrip("]").partition("[")
    if not topic or field not in series_of(bag, topic):
        return False
    return not number or int(number) < series_of(bag, topic)[field].shape[1]


def test_plotjuggler_layout_names_what_is_recorded(bag: Bag) -> None:
    curves = [str(node.get("name")) for node in ET.parse(LAYOUTS / "plotjuggler.xml").iter("curve")]
    assert len(curves) > 20
    assert [curve for curve in curves if not (plotjuggler_has(bag, curve) or curve.split("/")[-2] in GOVERNOR_S)] == []


def test_foxglove_layout_names_what_is_recorded(bag: Bag) -> None:
    panels = json.loads((LAYOUTS / "foxglove.json").read_text())["configById"].values()
    paths = [path for panel in panels for path in panel.get("paths", [])]
    assert len(paths) > 10
    assert [p for p in paths if not (foxglove_has(bag, p["value"]) or p.get("label") in GOVERNOR_S)] == []
    topics = [name for panel in panels for name in panel.get("topics", {})]
    topics += [layer["topic"] for panel in panels for layer in panel.get("layers", {}).values() if "topic" in layer]
    assert "/object_description" in topics
    assert [name for name in topics if name.removeprefix("/") not in TOPICS] == []


def test_named_numbers_of_the_controller_are_there() -> None:
    """PlotJuggler knows them by name, Foxglove by their place, which is that of an arm with seven joints."""
    names = [*published(7)[0], *(GOVERNED.names or ()), "mode", "path_speed"]
    curves = [str(node.get("name")) for node in ET.parse(LAYOUTS / "plotjuggler.xml").iter("curve")]
    scalars = [curve.split("/")[3] for curve in curves if curve.startswith("/controller/scalars/")]
    assert "load_ratio" in scalars
    assert set(scalars) <= set(names)
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    paths = [path for panel in layout["configById"].values() for path in panel.get("paths", [])]
    found = [path for path in paths if path["value"].startswith("/controller/scalars")]
    assert len(found) > 5
    for path in found:
        place = int(path["value"].partition("[")[2].rstrip("]"))
        assert names[place] == path["label"]


def test_topics_of_two_arms() -> None:
    """The bags of this repository are of one arm: of two arms the recorded topics are known, without fields."""
    recorded = {f"/{name}" for name, _ in recorded_topics(load_scenario("pane_two_arms_upright"))}
    curves = [str(node.get("name")) for node in ET.parse(LAYOUTS / "plotjuggler_two_arms.xml").iter("curve")]
    panels = json.loads((LAYOUTS / "foxglove_two_arms.json").read_text())["configById"].values()
    paths = [path["value"] for panel in panels for path in panel.get("paths", [])]
    paths += [name for panel in panels for name in panel.get("topics", {})]
    assert len(curves) > 30
    assert len(paths) > 20
    assert [
        path for path in (*curves, *paths) if not any(re.match(rf"{name}([/.\[]|$)", path) for name in recorded)
    ] == []


def test_absent_topics_and_fields(bag: Bag) -> None:
    assert not plotjuggler_has(bag, "/controller/stiffnes/wrench/force/x")
    assert not plotjuggler_has(bag, "/effort_command/arm_joint8/effort")
    assert not foxglove_has(bag, "/slip_truth.position[6]")
    assert not foxglove_has(bag, "/slip_truth.positions[0]")
