"""Holds docs/equations.md true: what its tables name exists, and every equation the law says it implements is there."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from slip_vic_controller.law.evaluation import EVALUATION

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "src" / "slip_vic_controller" / "slip_vic_controller"
SOURCES = [
    *(path for room in ("law", "path", "governor") for path in sorted((PACKAGE / room).glob("*.py"))),
    PACKAGE / "robot.py",
]
LAW = {1, 7, 8, 10, 11, 12, 13, 14, 17, 18, 21, 23, 24, 28, 29, 30}
"""Equations of which the paper's law consists."""
REFEREE = ROOT / "test" / "referees" / "law_referee.py"
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


FUNCTIONS = {f"{p.stem}.{name}": doc for p in SOURCES for name, doc in definitions(p).items()}
STATEMENTS = definitions(REFEREE)
CASES = {f"{p.stem}.{name}" for p in sorted((ROOT / "test" / "unit").glob("**/test_*.py")) for name in definitions(p)}
ROWS = [
    (numbers(cells[1]), re.findall(r"`([^`]+)`", cells[3]), re.findall(r"`([^`]+)`", cells[4]))
    for cells in (line.split("|") for line in PAGE.splitlines() if re.match(r"\| \(\d", line))
]


def test_page_has_its_tables() -> None:
    assert len(ROWS) > 25
    assert len(FUNCTIONS) > 50
    assert len(CASES) > 50
    assert len({functions[0] for _, functions, _ in ROWS}) == len(ROWS)


def test_rows_name_functions_and_tests_that_exist() -> None:
    for equations, functions, tests in ROWS:
        assert equations
        assert len(functions) == 1
        assert functions[0] in FUNCTIONS or functions[0] in STATEMENTS
        assert tests
        assert not [name for name in tests if name not in CASES]
        if functions[0] in FUNCTIONS:
            assert claims(FUNCTIONS[functions[0]]) == equations, functions[0]


def test_every_equation_of_the_law_is_named_where_it_runs() -> None:
    assert set().union(*map(claims, FUNCTIONS.values())) >= LAW


def test_every_equation_that_is_claimed_is_in_the_table() -> None:
    listed = {name for _, functions, _ in ROWS for name in functions}
    claimed = {name for name, doc in FUNCTIONS.items() if "Implements: Eq." in doc}
    assert claimed - listed == set()


def test_tests_named_in_the_text_exist() -> None:
    assert not [name for name in re.findall(r"`(test_\w+\.test_\w+)`", PAGE) if name not in CASES]


def test_records_named_on_the_page_have_these_fields() -> None:
    named = set(re.findall(r"`EVALUATION\.([\w.]+)`", PAGE))
    assert len(named) >= 7
    for name in named:
        kind = EVALUATION
        for part in name.split("."):
            assert kind.names is not None
            assert part in kind.names, name
            kind = kind[part]


def test_claims_are_read_from_docstrings() -> None:
    """The parser is not blind."""
    assert claims("Text.\n\nImplements: Eq. (10), (11): more.\nnot (12)") == {10, 11}
    assert claims("Implements: ours: the S of Eq. (10).") == set()
