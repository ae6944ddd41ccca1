"""Every public function of the law says what it implements."""

import ast
from pathlib import Path

from test.support.every import every

SRC = Path(__file__).parents[3] / "src"
FOLDERS = (SRC / "slip_vic_controller/slip_vic_controller/core",)
FILES = sorted(path for folder in FOLDERS for path in folder.rglob("*.py"))


def without_source(text: str) -> list[str]:
    """Return the public module-level functions that do not name their equation or reason.

    Parts of kernels belong to the kernel that calls them, and kernels name their plain form.
    """
    return [
        node.name
        for node in ast.parse(text).body
        if isinstance(node, ast.FunctionDef)
        and not node.name.startswith("_")
        and not any(isinstance(item, ast.Name) and item.id == "part" for item in node.decorator_list)
        and "Implements:" not in (ast.get_docstring(node) or "")
    ]


@every("path", FILES)
def test_public_functions_name_their_source(path: Path) -> None:
    assert without_source(path.read_text()) == []


def test_the_check_sees_a_missing_source() -> None:
    assert without_source('def f():\n    """Return nothing."""') == ["f"]


def test_only_parts_are_exempt() -> None:
    assert without_source("@kernel(VOID)\ndef f():\n    pass") == ["f"]
    assert without_source("@part\ndef f():\n    pass") == []
