"""The results that the repository holds: the tables of the page are those of their rows."""

import runpy

from slip_vic.experiments.suite import read_result
from test.support.pages import ROOT

TOOL = runpy.run_path(str(ROOT / "tools" / "benchmark_tables.py"))


def test_tables_of_the_page() -> None:
    assert TOOL["PAGE"].read_text() == TOOL["page"](TOOL["results"]()), "run: python tools/benchmark_tables.py"
    assert TOOL["PAGE"].read_text().count(TOOL["BEGIN"]) == 1


def test_no_row_was_changed_and_all_laws_have_the_first_worlds() -> None:
    found = [read_result(file.parent) for file in TOOL["FOLDER"].glob("*/rows.json")]
    assert len(found) >= 9
    for arms, least in (("1", 30), ("2", 20)):
        for worlds in ({int(row["world"]) for row in rows if row["arms"] == arms} for rows in found):
            assert not worlds or len(worlds) >= least
            assert worlds == {*range(1, 1 + len(worlds))}, "a law is judged in the first worlds"
