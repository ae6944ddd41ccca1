"""Tables and picture of rows: they fit into 80 columns, and count what rows say."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from slip_vic.experiments.run import COLUMNS, METRICS, Row
from slip_vic.experiments.tables import lines_of, tables_of, write_picture


def row(sensor: str, law: str, outcome: str = "ok", slip_mm: float = 0.0, **more: Any) -> Row:
    cells = {"set": "study", "world": "0", "scenario": "glass_transport", "mismatch": "none", "arms": "1",
             "sensor": sensor, "law": law}  # fmt: skip
    numbers = dict.fromkeys(METRICS, "0.0001") | {"slip_path_m": str(1e-3 * slip_mm)}
    return dict.fromkeys(COLUMNS, "") | numbers | cells | {"outcome": outcome} | more


def test_tables_fit_into_80_columns_with_the_longest_names() -> None:
    (table,) = tables_of([
        row("force_tactile_500", "classical", slip_mm=5.26),
        row("force_tactile_500", "governed"),
        row("optical_flow_120", "governed", slip_mm=1.0),
        row("optical_flow_120", "governed", "fault", 123.4),
    ])  # fmt: skip
    assert max(map(len, table.splitlines())) <= 80
    lines = [line.split()[:5] for line in table.splitlines()]
    assert ["force_tactile_500", "classical", "1/1", "0", "5.26"] in lines
    assert ["optical_flow_120", "governed", "1/2", "1", "inf"] in lines


def test_drawn_worlds_compare_laws_with_classical_control() -> None:
    worlds = ("ok", "ok"), ("ok", "fault"), ("lost", "lost")
    rows = [
        row("ideal", law, outcome, set="drawn 3", world=str(k), digest=str(k), scenario=f"s{k}")
        for k, pair in enumerate(worlds)
        for law, outcome in zip(("classical", "vic"), pair, strict=True)
    ]
    lines = {line["law"]: line for line in lines_of(rows)}
    assert [lines["vic"][name] for name in ("carried", "lost", "lost alone")] == ["1/3", "2", "1/3"]
    assert lines["classical"]["lost alone"] == "0/3"


def test_no_law_looks_better_by_what_it_does_not_carry() -> None:
    """Four worlds in which the pad slides by 1 mm each: arrived, late, left short, never left; then one lost."""
    cases = [("ok", 1.0, 0.0), ("ok", math.nan, 0.01), ("ok", math.nan, 0.03), ("stays", math.nan, 0.0)]
    cases.append(("fault", math.nan, 0.0))
    rows = [
        row("", "law", outcome, 1.0, set="carry", world=str(k), arrival_s=repr(arrival), off_goal_m=repr(error))
        for k, (outcome, arrival, error) in enumerate(cases)
    ]
    (line,) = lines_of(rows)
    assert [line[name] for name in ("carried", "lost", "short", "held", "late")] == ["2/5", "1", "1", "1", "1"]
    assert (line["slip [mm]"], line["arrives [s]"], line["peak [N]"]) == ("inf", "inf", "0.0001")
    assert next(lines_of(rows[:3]))["slip [mm]"] == "1"


def test_picture_of_missing_numbers(tmp_path: Path) -> None:
    write_picture(tmp_path / "rows.png", [row("ideal", "vic", "crashed", **dict.fromkeys(METRICS, "nan"))])
    assert (tmp_path / "rows.png").stat().st_size > 1000
