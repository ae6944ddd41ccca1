"""The page of errors has every reason, every fault and every error text of the sources."""

from __future__ import annotations

import ast
import runpy
from pathlib import Path

import pytest

from slip_vic_controller.safety.conditions import Reason
from test.support.pages import ROOT

TOOL = runpy.run_path(str(ROOT / "tools" / "troubleshooting.py"))


@pytest.mark.parametrize(("path", "text"), TOOL["pages"]().items(), ids=lambda given: getattr(given, "name", ""))
def test_the_page_is_that_of_the_sources(path: Path, text: str) -> None:
    assert path.read_text() == text, "run: python tools/troubleshooting.py"


def test_every_reason_has_what_to_do() -> None:
    assert all(reason.words and reason.to_do for reason in Reason if reason != Reason.NONE)


def test_texts_are_taken_from_the_source() -> None:
    text = (
        'raise InputError(f"joint {name}", got=3, expected="a" + "b", fix="" if x else "mend")\nraise ValueError("v")'
    )
    found = list(TOOL["raised"](ast.parse(text), declares=False))
    assert found == [("joint …", "ab", "mend")]
    assert ("parameter …", "v", "") in TOOL["raised"](ast.parse(text), declares=True)
