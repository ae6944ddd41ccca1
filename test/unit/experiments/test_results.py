"""The results that the repository holds: tables and picture of the pages are those of their rows."""

import json
import runpy

from slip_vic.experiments.compare import HEAD, lines_of
from slip_vic.experiments.rows import digest_of
from slip_vic.experiments.suite import DIGEST, read_result
from test.support.pages import ROOT

TOOL = runpy.run_path(str(ROOT / "tools" / "benchmark_tables.py"))
LAWS = TOOL["results"]()


def test_the_tables_of_the_pages_are_those_of_the_results() -> None:
    for page in TOOL["PAGES"]:
        assert page.read_text() == TOOL["page"](page, LAWS), "run: python tools/benchmark_tables.py"
        assert page.read_text().count(TOOL["BEGIN"]) == 1


def test_the_kept_table_is_those_of_the_results() -> None:
    kept = json.loads((TOOL["FOLDER"] / "compare.json").read_text())
    lines = [line for arms in (1, 2) for line in lines_of(LAWS, arms)]
    assert kept["digest"] == DIGEST
    assert kept["laws"] == [dict(zip(HEAD, line, strict=True)) for line in lines]


def test_no_row_was_changed_and_all_laws_have_the_same_worlds() -> None:
    assert len(LAWS) >= 9
    for file in TOOL["FOLDER"].glob("*/result.json"):
        law = read_result(file.parent)
        assert law.digest == digest_of(law.rows), file
    for arms in ("1", "2"):
        worlds = {frozenset(row["world"] for row in law.rows if row["arms"] == arms) for law in LAWS}
        assert len(worlds - {frozenset()}) == 1
