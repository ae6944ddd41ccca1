"""Tables and picture of a study: they fit into 80 columns, and count what rows say."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from rich.console import Console

from slip_vic.experiments.rows import COLUMNS, Row
from slip_vic.experiments.run import METRICS
from slip_vic.experiments.tables import spread, summary_tables, write_picture


def row(sensor: str, law: str, outcome: str = "ok", slip_mm: float = 0.0, **more: Any) -> Row:
    cells = {
        "set": "study",
        "world": "0",
        "scenario": "glass_transport",
        "mismatch": "none",
        "sensor": sensor,
        "law": law,
    }
    numbers = dict.fromkeys(METRICS, "0.0001") | {"slip_linear_m": str(1e-3 * slip_mm)}
    return dict.fromkeys(COLUMNS, "") | numbers | cells | {"outcome": outcome} | more


def shown(rows: list[Row], width: int = 80) -> list[list[str]]:
    with io.StringIO() as file:
        Console(file=file, width=width).print(*summary_tables(rows), sep="\n")
        return [line.split() for line in file.getvalue().splitlines()]


def test_tables_fit_into_80_columns_with_the_longest_names() -> None:
    lines = shown([
        row("force_tactile_500", "classical", slip_mm=5.26),
        row("force_tactile_500", "governed"),
        row("optical_flow_120", "governed", slip_mm=1.0),
        row("optical_flow_120", "governed", "fault", 123.4),
    ])  # fmt: skip
    assert not any("…" in word for line in lines for word in line)
    assert ["force_tactile_500", "classical", "1/1", "0"] in [line[:4] for line in lines]
    assert ["optical_flow_120", "governed", "1/2", "1", "62.20", "/", "123"] in [line[:7] for line in lines]


def test_drawn_worlds_compare_laws_with_classical_control() -> None:
    worlds = ((("ok", 40.0), ("ok", 2.0)), (("ok", 1.0), ("fault", 0.0)), (("lost", 99.0), ("ok", 20.0)))
    rows = [
        row("ideal", law, outcome, slip, set="drawn 3", world=str(k), digest=str(k), scenario=f"s{k}")
        for k, pair in enumerate(worlds)
        for law, (outcome, slip) in zip(("classical", "vic"), pair, strict=True)
    ]
    lines = shown(rows, 120)
    (line,) = (line for line in lines if line[:1] == ["vic"])
    assert line[1:3] == ["2/3", "1"]
    assert line[-1] == "1/3", "lost where classical control keeps it"


def test_spread_is_median_interval_and_worst() -> None:
    s = spread(range(101))
    assert s.median == 50.0
    assert s.low < 50.0 < s.high
    assert s.high < 60.0
    assert s.worst == 100.0


def test_picture_of_missing_numbers(tmp_path: Path) -> None:
    write_picture(tmp_path / "study.png", [row("ideal", "vic", "crashed", **dict.fromkeys(METRICS, "nan"))])
    assert (tmp_path / "study.png").exists()
