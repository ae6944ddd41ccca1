"""Write picture and tables of the benchmark in docs/your_law.md, from the results in docs/benchmark.

python tools/benchmark_tables.py         # writes picture, rows and tables again
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from slip_vic.experiments.compare import HEAD, joined, lines_of, write
from slip_vic.experiments.suite import LawRows

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "benchmark"
COLUMNS = (
    "law",
    "grip",
    "arms",
    "worlds",
    "carried",
    "lost",
    "short",
    "late",
    "slip [mm]",
    "arrives [s]",
    "peak [N]",
    "mean [N]",
)
PAGES = {ROOT / "docs" / "your_law.md": COLUMNS}
"""Pages, and the columns that each of them shows."""
BEGIN, END = "<!-- begin: made by tools/benchmark_tables.py -->", "<!-- end -->"


def results() -> list[LawRows]:
    """Return the results that the repository holds."""
    return joined(sorted(path.parent for path in FOLDER.glob("*/result.json")))


def markdown(lines: Sequence[Sequence[str]], columns: Sequence[str]) -> Iterator[str]:
    """Yield the lines of a table with some columns of `compare`."""
    yield f"| {' | '.join(columns)} |"
    yield "|---|---|" + "--:|" * (len(columns) - 2)
    for line in lines:
        cells = dict(zip(HEAD, line, strict=True))
        yield f"| `{cells['law']}` | {' | '.join(cells[name] for name in columns[1:])} |"


def page(path: Path, laws: Sequence[LawRows]) -> str:
    """Return a page with its table as the results have it."""
    parts = []
    for arms in (1, 2) if "arms" in PAGES[path] else (1,):
        lines = lines_of(laws, arms)
        parts += ["\n".join(markdown(lines, PAGES[path]))] if lines else []
    made = "\n".join((BEGIN, "\n\n".join(parts), END))
    return re.sub(f"{re.escape(BEGIN)}.*?{re.escape(END)}", lambda _: made, path.read_text(), flags=re.DOTALL)


if __name__ == "__main__":
    found = results()
    write(found, FOLDER)
    for path in PAGES:
        path.write_text(page(path, found))
