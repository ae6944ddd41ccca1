"""Write the tables of docs/faults.md, docs/safety.md and docs/troubleshooting.md from the sources.

python tools/troubleshooting.py          # rewrites what is between their marks

Cause and fix of each reason are rows of docs/faults.csv.
"""

from __future__ import annotations

import ast
import csv
import re
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path

from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.safety.conditions import Mode, Reason

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
BEGIN, END = "<!-- begin: made by tools/troubleshooting.py -->", "<!-- end -->"


def causes() -> dict[str, tuple[str, str]]:
    """Return cause and fix of each reason by its name."""
    with (DOCS / "faults.csv").open(encoding="utf-8", newline="") as file:
        return {row["reason"]: (row["cause"], row["fix"]) for row in csv.DictReader(file)}


NAMES = {"joint": "JOINT", "value": "X", "limit": "Y", "fault": "is ...", "missing": "TOPIC", "which": "T",
         "sensor": "SENSOR", "mistake": "..."}  # fmt: skip


def shown(words: str) -> str:
    """Return the words of a reason with names for what is known at run time only."""
    return re.sub(r"\{(\w+)[^}]*\}", lambda found: NAMES[found[1]], words)


def reason_table() -> str:
    """Return a table for each mode: its reasons, in the order in which they count."""
    known, parts = causes(), []
    for mode in dict.fromkeys(one.mode for one in Reason if one.mode != Mode.ACTIVE):
        rows = [(shown(one.words), *known[one.name], one.name) for one in Reason if one.mode == mode]
        parts.append(f"## {mode.name}\n\n{_table(('you see', 'cause', 'fix', 'reason'), rows)}")
    return "\n\n".join(parts)


def fault_table() -> str:
    """Return the table of what can be wrong with an input."""
    known = causes()
    samples = [one for one in Reason if one.mode == Mode.ACTIVE and one != Reason.NONE]
    return _table(("the input ...", "cause", "fix"), [(shown(one.words), *known[one.name]) for one in samples])


def sensor_table() -> str:
    """Return the table of mistakes that the readings of a slip sensor show."""
    rows = []
    for fix, group in groupby((health for health in SensorHealth if health.to_do), lambda health: health.to_do):
        words = [shown(health.words) for health in group]
        start, _, _ = words[0].rpartition(": ")
        rows.append(("; ".join(word.removeprefix(f"{start}: ") if k else word for k, word in enumerate(words)), fix))
    return _table(("slip_velocity ...", "fix"), rows)


def condition_table() -> str:
    """Return the table of docs/safety.md: every condition, in the order in which it counts."""
    rows = [
        (
            shown(one.words), one.mode.name, f"{1e3 * one.lasts_s:.0f} ms" if one.lasts_s else "",
            "yes" if one.clears else "no",
        )
        for one in Reason if one.mode != Mode.ACTIVE
    ]  # fmt: skip
    return _table(("condition", "mode", "lasts", "clears by itself"), rows)


STEPS = {"stream": "joint_states, wrench, slip", "in_mode": "mode", "controller": "controller", "rest": "rest",
         "weighed": "weight", "slid": "slide", "turned": "joint ...", "pushed": "push ...", "drifted": "hold, gravity",
         "first_motion": "first motion", "friction": "friction"}  # fmt: skip
"""Steps of a bring-up by the functions that judge them."""


def bringup_table() -> str:
    """Return the table of the fixes that `slip-vic bringup` prints where a step fails."""
    walk = ROOT / "src/slip_vic/slip_vic/setup/bringup/walk.py"
    rows = []
    for function in ast.walk(ast.parse(walk.read_text(encoding="utf-8"))):
        if isinstance(function, ast.FunctionDef):
            name = STEPS.get(function.name.strip("_"), "")
            fixes = [rendered(fix) for node in ast.walk(function) for fix in _fixes(node)]
            rows += [(name, text) for text in fixes if text.strip("…")]
    return _table(("step", "fix"), rows)


def rendered(node: ast.expr) -> str:
    """Return the text of an expression, with … for what is known at run time only."""
    match node:
        case ast.Constant(value=value):
            return str(value)
        case ast.JoinedStr(values=parts):
            return "".join(rendered(part) for part in parts)
        case ast.IfExp(body=body, orelse=other):
            return " or ".join(text for text in (rendered(body), rendered(other)) if text)
    return "…"


def _fixes(node: ast.AST) -> Iterator[ast.expr]:
    """Yield the fixes that a call of `judge` has."""
    match node:
        case ast.Call(func=ast.Name(id="judge"), args=[_, _, _, *faults]):
            yield from (fix for fault in faults for fix in (fault.elts[1:] if isinstance(fault, ast.Tuple) else ()))


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    cells = [[text.replace("|", "\\|").replace("<", "&lt;") or " " for text in row] for row in rows]
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *cells)).replace(" --- ", "---")


def pages() -> dict[Path, str]:
    """Return every page that has a part made here."""
    made = {
        "faults.md": (
            f"{reason_table()}\n\n## Faults of an input\n\nThe reason names the input. The reaction is "
            f"in [safety](safety.md#reactions-to-inputs).\n\n{fault_table()}\n\n## The readings of the slip sensor\n\n"
            f"{sensor_table()}"
        ),
        "safety.md": condition_table(),
        "troubleshooting.md": bringup_table(),
    }
    return {DOCS / name: _between(DOCS / name, text) for name, text in made.items()}


def _between(path: Path, made: str) -> str:
    """Return a whole page, with what is made between its marks."""
    before, _, rest = path.read_text(encoding="utf-8").partition(BEGIN)
    return f"{before}{BEGIN}\n\n{made}\n\n{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
