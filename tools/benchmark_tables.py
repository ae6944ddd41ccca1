"""Write picture and tables of the benchmark in docs/your_law.md, from the results in docs/benchmark.

python tools/benchmark_tables.py         # writes picture and tables again
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from slip_vic.experiments.run import Row
from slip_vic.experiments.suite import compared
from slip_vic.experiments.tables import lines_of, write_picture

ROOT = Path(__file__).parents[1]
FOLDER, PAGE = ROOT / "docs" / "benchmark", ROOT / "docs" / "your_law.md"
COLUMNS = (
    "law", "track", "arms", "carried", "lost", "short", "late", "slip [mm]", "arrives [s]", "x fastest", "peak [N]",
    "mean [N]", "x least",
)  # fmt: skip
BEGIN, END = "<!-- begin: made by tools/benchmark_tables.py -->", "<!-- end -->"


def results() -> list[Row]:
    """Return the rows that the repository holds."""
    return compared(sorted(path.parent for path in FOLDER.glob("*/rows.json")))


def markdown(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of the table: the tracks by themselves, in each first what carries most."""
    yield f"| {' | '.join(COLUMNS)} |"
    yield "|---|---|" + "--:|" * (len(COLUMNS) - 2)
    for line in sorted(lines_of(rows), key=lambda line: (line["track"], -int(line["carried"].partition("/")[0]))):
        yield f"| `{line['law']}` | {' | '.join(line[name] for name in COLUMNS[1:])} |"


def page(rows: Sequence[Row]) -> str:
    """Return the page with its tables as the results have them."""
    groups = [[row for row in rows if row["arms"] == arms] for arms in ("1", "2")]
    made = "\n".join((BEGIN, "\n\n".join("\n".join(markdown(group)) for group in groups), END))
    return re.sub(f"{re.escape(BEGIN)}.*?{re.escape(END)}", lambda _: made, PAGE.read_text(), flags=re.DOTALL)


if __name__ == "__main__":
    found = results()
    write_picture(FOLDER / "rows.png", [row for row in found if row["arms"] == "1"])
    PAGE.write_text(page(found))
