"""What changed between two ``bench.json``, beyond the noise that both of them show."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from slip_core.errors import InputError
from test.campaigns.bench.samples import Metric, metric_from

LEAST_CHANGE = 0.02  # smaller changes are not worth a line, however quiet the machine


@dataclass(frozen=True, slots=True)
class Change:
    """One metric in two files. verdict: better, worse, same (within the noise), new or gone."""

    name: str
    before: Metric | None
    after: Metric | None
    verdict: str

    @property
    def relative(self) -> float:
        """Change of the median relative to the first file, NaN where one side is missing."""
        if self.before is None or self.after is None or self.before.median == 0.0:
            return float("nan")
        return self.after.median / self.before.median - 1.0


def read_metrics(path: Path) -> dict[str, Metric]:
    """Read the metrics of a ``bench.json``.

    Raises:
        InputError: missing file, not JSON, or not written by this command.
    """
    try:
        stored: Any = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"file {path}", got=error, expected="a readable bench.json") from None
    except ValueError as error:
        raise InputError(f"file {path}", got=str(error), expected="JSON") from None
    metrics = stored.get("metrics") if isinstance(stored, dict) else None
    if not isinstance(metrics, dict):
        raise InputError(f"file {path}", got="no metrics", expected="a bench.json of ./run bench")
    return {name: metric_from(name, value) for name, value in metrics.items()}


def judge(name: str, before: Metric | None, after: Metric | None) -> Change:
    """Say whether a metric changed: all rounds of one file beyond all of the other, and by more than 2 %."""
    if before is None or after is None:
        return Change(name, before, after, "new" if before is None else "gone")
    if not before.values or not after.values:
        return Change(name, before, after, "same")
    apart = after.low > before.high or after.high < before.low
    scale = max(abs(before.median), abs(after.median))
    if not apart or abs(after.median - before.median) <= LEAST_CHANGE * scale:
        return Change(name, before, after, "same")
    rose = after.median > before.median
    return Change(name, before, after, "better" if rose == (after.better == "high") else "worse")


def compare(before: Mapping[str, Metric], after: Mapping[str, Metric]) -> list[Change]:
    """Judge every metric of either file; those that changed come first."""
    names = [*before, *(name for name in after if name not in before)]
    changes = [judge(name, before.get(name), after.get(name)) for name in names]
    return sorted(changes, key=lambda change: change.verdict == "same")


def comparison_table(changes: list[Change]) -> Table:
    """Return the table of ``./run bench --compare``."""
    table = Table(title="what changed beyond the noise of both files")
    for heading in ("", "before", "after", "change", "verdict"):
        table.add_column(heading, justify="left" if not heading else "right")
    for change in changes:
        values = [f"{m.median:.4g} {m.unit}" if m is not None else "-" for m in (change.before, change.after)]
        relative = f"{100.0 * change.relative:+.1f} %" if change.relative == change.relative else ""
        table.add_row(change.name, *values, relative, change.verdict)
    return table
