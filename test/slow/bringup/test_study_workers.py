"""The study's worker processes: one that dies costs one row, and the command goes on where it stopped."""

from __future__ import annotations

import csv
import importlib
from pathlib import Path

import pytest
from click.testing import CliRunner

from slip_bringup.cli import cli
from slip_bringup.study.cases import Case
from slip_bringup.study.runner import run_cases

SHORT = ("bridge.duration_s=0.05",)


WORKER = """
import os
from slip_bringup.study.run_case import METRICS, CaseResult

def picky(case, assignments):
    if case.seed == 1:
        os._exit(3)
    return CaseResult(case, "ok", "", dict.fromkeys(METRICS, 1.0))
"""


def test_a_worker_that_dies_costs_one_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The worker is a module of its own: new processes must be able to import it."""
    (tmp_path / "picky_worker.py").write_text(WORKER)
    monkeypatch.syspath_prepend(tmp_path)
    picky = importlib.import_module("picky_worker").picky
    cases = [Case("paper_planar", "event_1000", "observer", "none", seed) for seed in range(4)]
    results = {r.case.seed: r for r in run_cases(cases, (), 2, picky)}
    assert sorted(results) == [0, 1, 2, 3]
    assert results[1].outcome == "crashed"
    assert all(results[seed].outcome == "ok" for seed in (0, 2, 3))


def test_command_writes_table_and_picture(tmp_path: Path) -> None:
    arguments = ["study", "--sensors", "ideal,vision_25", "--seeds", "1", "--jobs", "2", "--out", str(tmp_path / "s")]
    ran = CliRunner().invoke(cli, [*arguments, "--set", SHORT[0]], catch_exceptions=False)
    assert ran.exit_code == 0, ran.output
    with (tmp_path / "s/study.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {(row["sensor"], row["estimator"]) for row in rows} == {
        (sensor, estimator) for sensor in ("ideal", "vision_25") for estimator in ("classical", "measured", "observer")
    }
    assert (tmp_path / "s/study.png").stat().st_size > 10_000
    again = CliRunner().invoke(cli, [*arguments, "--set", SHORT[0]], catch_exceptions=False)
    assert "6 of 6 cases were there already" in again.output
