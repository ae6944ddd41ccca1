"""The viewer layouts name topics and fields that the nodes publish."""

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

from slip_core.topics import TOPICS

LAYOUTS = Path(__file__).parents[3] / "config" / "layouts"


def known(path: str) -> bool:
    return any(re.match(rf"/{re.escape(name.lstrip('/'))}(?:[/.\[]|$)", path) for name in TOPICS)


def test_plotjuggler_layout_names_published_topics() -> None:
    curves = [node.get("name") for node in ET.parse(LAYOUTS / "plotjuggler.xml").iter("curve")]
    assert len(curves) > 20
    assert [curve for curve in curves if not known(str(curve))] == []


def test_foxglove_layout_names_published_topics() -> None:
    layout = json.loads((LAYOUTS / "foxglove.json").read_text())
    paths = [p["value"] for panel in layout["configById"].values() for p in panel.get("paths", [])]
    topics = [name for panel in layout["configById"].values() for name in panel.get("topics", {})]
    assert len(paths) > 10
    assert [path for path in paths + topics if not known(path)] == []


def test_the_check_sees_a_foreign_topic() -> None:
    assert not known("/controller/stiffnes.wrench.force.x")
