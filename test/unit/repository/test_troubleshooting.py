"""The pages of faults have every reason and every fault of the sources, each with a cause and a fix."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from slip_vic_controller.safety.conditions import Reason
from test.support.pages import ROOT

TOOL = runpy.run_path(str(ROOT / "tools" / "troubleshooting.py"))


@pytest.mark.parametrize(("path", "text"), TOOL["pages"]().items(), ids=lambda given: getattr(given, "name", ""))
def test_the_page_is_that_of_the_sources(path: Path, text: str) -> None:
    assert path.read_text() == text, "run: python tools/troubleshooting.py"


def test_every_reason_has_a_cause_and_a_fix() -> None:
    known = TOOL["causes"]()
    assert list(known) == [reason.name for reason in Reason if reason != Reason.NONE]
    assert all(reason.words for reason in Reason if reason != Reason.NONE)
    assert all(re.search(r"[a-z~]{3}", text) for pair in known.values() for text in pair), "an empty cause or fix"
