"""The mutation tool: its mutants differ from the original in one place, and its lists name real ones."""

from __future__ import annotations

import ast
import importlib.util
import random
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[3]
SAMPLE = 60


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    loader = SourceFileLoader("mutate", str(ROOT / "tools" / "mutate"))
    spec = importlib.util.spec_from_loader("mutate", loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["mutate"] = module  # its dataclass asks for it
    loader.exec_module(module)
    return module


def test_mutants_differ_in_one_place(tool: ModuleType) -> None:
    found = tool.all_mutants()
    assert len({mutant.name for mutant in found}) == len(found)
    assert {mutant.part for mutant in found} == {part for part, _, _ in tool.PARTS}
    for mutant in random.Random(1).sample(found, SAMPLE):
        good = (ROOT / mutant.path).read_bytes()
        changed = good[: mutant.start] + mutant.text.encode() + good[mutant.end :]
        assert ast.dump(ast.parse(changed)) != ast.dump(ast.parse(good)), mutant.name


def test_equivalent_mutants_have_a_reason(tool: ModuleType) -> None:
    lines = [line for line in tool.EQUIVALENT.read_text().splitlines() if line and not line.startswith("#")]
    assert all(len(line.partition(" | ")[2]) > 10 for line in lines)


def test_every_part_has_sources_and_tests(tool: ModuleType) -> None:
    for _, source, tests in tool.PARTS:
        assert (ROOT / source).exists(), source
        assert tool.test_paths(tests), source
