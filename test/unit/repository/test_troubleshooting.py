"""The page of errors has every reason, every fault and every error text of the sources."""

from __future__ import annotations

import ast
import runpy

from slip_vic_controller.safety.faults import Fault
from slip_vic_controller.safety.reasons import Cause
from test.support.pages import ROOT

TOOL = runpy.run_path(str(ROOT / "tools" / "troubleshooting.py"))


def test_the_page_is_that_of_the_sources() -> None:
    assert TOOL["PAGE"].read_text() == TOOL["page"](), "run: python tools/troubleshooting.py"


def test_every_reason_and_fault_has_what_to_do() -> None:
    assert set(TOOL["TO_DO"]) == set(Cause) - {Cause.NONE}
    assert set(TOOL["FAULT_TO_DO"]) == set(Fault) - {Fault.NONE}


def test_texts_are_taken_from_the_source() -> None:
    text = (
        'raise InputError(f"joint {name}", got=3, expected="a" + "b", fix="" if x else "mend")\nraise ValueError("v")'
    )
    found = list(TOOL["raised"](ast.parse(text), declares=False))
    assert found == [("joint …", "ab", "mend")]
    assert ("parameter …", "v", "") in TOOL["raised"](ast.parse(text), declares=True)
