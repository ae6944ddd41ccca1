"""Holds docs/equations.md true: what its table names exists, and every equation core says it implements is there."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CORE = ROOT / "src" / "slip_vic_controller" / "slip_vic_controller" / "core"
TESTS = ROOT / "test" / "core"
PAGE = (ROOT / "docs" / "equations.md").read_text(encoding="utf-8")


def definitions(path: Path) -> dict[str, str]:
    """Return every function and method of a file as "name" or "Class.name", with its docstring."""
    found = {}
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            found[node.name] = ast.get_docstring(node) or ""
        elif isinstance(node, ast.ClassDef):
            for inner in node.body:
                if isinstance(inner, ast.FunctionDef):
                    found[f"{node.name}.{inner.name}"] = ast.get_docstring(inner) or ""
    return found


def numbers(text: str) -> set[int]:
    return {int(n) for n in re.findall(r"\((\d+)\)", text)}


def claims(docstring: str) -> set[int]:
    """Return the equation numbers of a docstring's `Implements: Eq.` line."""
    line = docstring.partition("Implements: Eq.")[2].partition("\n")[0]
    return numbers(line)


FUNCTIONS = {f"{p.stem}.{name}": doc for p in sorted(CORE.glob("*.py")) for name, doc in definitions(p).items()}
CASES = {f"{p.stem}.{name}" for p in sorted(TESTS.glob("test_*.py")) for name in definitions(p)}
ROWS = [
    (numbers(cells[1]), re.findall(r"`([^`]+)`", cells[3]), re.findall(r"`([^`]+)`", cells[4]))
    for cells in (line.split("|") for line in PAGE.splitlines() if re.match(r"\| \(\d", line))
]


def test_page_has_a_table() -> None:
    assert len(ROWS) > 30
    assert len(FUNCTIONS) > 50
    assert len(CASES) > 50


@pytest.mark.parametrize(("equations", "functions", "tests"), ROWS, ids=[" ".join(row[1]) for row in ROWS])
def test_row_names_functions_and_tests_that_exist(equations: set[int], functions: list[str], tests: list[str]) -> None:
    assert equations
    assert len(functions) == 1
    assert functions[0] in FUNCTIONS
    assert tests
    assert not [name for name in tests if name not in CASES]
    assert claims(FUNCTIONS[functions[0]]) == equations


def test_every_equation_in_core_is_in_the_table() -> None:
    listed = {name for _, functions, _ in ROWS for name in functions}
    claimed = {name for name, doc in FUNCTIONS.items() if "Implements: Eq." in doc}
    assert claimed - listed == set()


def test_tests_named_in_the_text_exist() -> None:
    assert not [name for name in re.findall(r"`(test_\w+\.test_\w+)`", PAGE) if name not in CASES]


def test_claims_are_read_from_docstrings() -> None:
    """The parser is not blind."""
    assert claims("Text.\n\nImplements: Eq. (10), (11): more.\nnot (12)") == {10, 11}
    assert claims("Implements: ours: the S of Eq. (10).") == set()
