"""The mutation tool: its mutants differ from the original in one place, and its lists name real ones."""

from __future__ import annotations

import argparse
import ast
import importlib.util
import random
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

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


def test_every_mutant_is_a_program_that_differs_in_one_place(tool: ModuleType) -> None:
    found = tool.all_mutants()
    assert len({mutant.name for mutant in found}) == len(found)
    assert {mutant.part for mutant in found} == {"core", "arm", "safety", "observer", "sim", "codec", "bags"}
    for mutant in random.Random(1).sample(found, SAMPLE):
        good = (ROOT / mutant.path).read_bytes()
        changed = good[: mutant.start] + mutant.text.encode() + good[mutant.end :]
        assert ast.dump(ast.parse(changed)) != ast.dump(ast.parse(good)), mutant.name


def test_the_survivors_that_were_found_once_are_among_them(tool: ModuleType) -> None:
    """Their tests are in the folders of their parts; here it is seen that the tool would find them again."""
    names = "\n".join(mutant.name for mutant in tool.all_mutants())
    for words in (
        "sense: samples[0].slip_twist[:] = observer.twist -> removed",
        "next_mode: good_since == NEVER or now_ns - good_since < policy.resume_after_ns -> good_since == NEVER and",
        "degradation_level: now_ns - since.slip_unknown_ns -> now_ns + since.slip_unknown_ns",
        "step: self._diverged = True -> removed",
        "accelerations: force / model.mass -> force * model.mass",
    ):
        assert words in names, words


def test_a_sample_is_that_of_its_seed_and_takes_from_every_part(tool: ModuleType) -> None:
    def sample(seed: int) -> list[Any]:
        found: list[Any] = tool.chosen(argparse.Namespace(part="", only=None, seed=seed, count=70))
        return found

    assert sample(1) == sample(1) != sample(2)
    parts = [mutant.part for mutant in sample(1)]
    assert all(parts.count(part) == 10 for part in set(parts))


def test_what_is_judged_equivalent_exists_and_says_why(tool: ModuleType) -> None:
    names = {mutant.name for mutant in tool.all_mutants()}
    assert tool.equivalent() <= names
    lines = [line for line in tool.EQUIVALENT.read_text().splitlines() if line and not line.startswith("#")]
    assert all(len(line.partition(" | ")[2]) > 10 for line in lines)
