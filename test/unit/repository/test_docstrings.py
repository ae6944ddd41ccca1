"""Docstrings of the controller's formulas: every public part says what it does, every equation of the law is named."""

import ast
import re
from pathlib import Path

import pytest

SRC = Path(__file__).parents[3] / "src/slip_vic_controller/slip_vic_controller"
FOLDERS = ("law", "contact", "path", "governor", "safety")
FILES = sorted(path for folder in FOLDERS for path in (SRC / folder).rglob("*.py"))
EQUATIONS = {1, 7, 8, 10, 11, 12, 13, 14, 17, 18, 21, 23, 24, 28, 29, 30}
"""What the paper's law consists of."""


def undocumented(text: str) -> list[str]:
    """Return the public functions and classes without a docstring."""
    return [
        node.name
        for node in ast.parse(text).body
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
        and not node.name.startswith("_")
        and not ast.get_docstring(node)
    ]


def equations(text: str) -> set[int]:
    """Return the numbers of the equations that a text says it implements."""
    lines = re.findall(r"Implements: (Eq\. .*)", text)
    return {int(number) for line in lines for number in re.findall(r"\((\d+)\)", line)}


@pytest.mark.parametrize("path", FILES)
def test_public_formulas_say_what_they_do(path: Path) -> None:
    assert undocumented(path.read_text()) == []


def test_every_equation_of_the_law_is_named_where_it_runs() -> None:
    assert set().union(*(equations(path.read_text()) for path in FILES)) >= EQUATIONS


def test_the_checks_see_what_is_missing() -> None:
    assert undocumented("def f():\n    pass") == ["f"]
    assert equations("Implements: Eq. (10), (14): a.") == {10, 14}
    assert equations("see Eq. (10)") == set()
