"""Write the tables of docs/troubleshooting.md: reasons of a mode, faults, steps of a bring-up, error texts, from the sources.

python tools/troubleshooting.py          # writes them, and the conditions of docs/safety.md, between their marks again
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.safety.conditions import Reason, Severity

ROOT = Path(__file__).parents[1]
PAGE, SAFETY = ROOT / "docs" / "troubleshooting.md", ROOT / "docs" / "safety.md"
ERRORS = ("InputError", "ProtocolError", "RefusedByChild", "MixedVersions", "DivergenceError")
BEGIN, END = "<!-- begin: made by tools/troubleshooting.py -->", "<!-- end -->"


def rendered(node: ast.expr | None) -> str:
    """Return the text of an expression, with … for what is known at run time only."""
    match node:
        case ast.Constant(value=value):
            return str(value)
        case ast.JoinedStr(values=parts):
            return "".join(rendered(part) for part in parts)
        case ast.BinOp(left=left, op=ast.Add(), right=right):
            return rendered(left) + rendered(right)
        case ast.IfExp(body=body, orelse=other):
            return " or ".join(text for text in (rendered(body), rendered(other)) if text)
        case None:
            return ""
    return "…"


def raised(tree: ast.AST, *, declares: bool) -> Iterator[tuple[str, str, str]]:
    """Yield what, expected and fix of every error of ours that a module makes; declares: one that declares parameters."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
            continue
        if node.func.id in ERRORS and node.args:
            named = {keyword.arg: keyword.value for keyword in node.keywords}
            yield rendered(node.args[0]), rendered(named.get("expected")), rendered(named.get("fix"))
        elif node.func.id == "UnknownName":
            where = {keyword.arg: rendered(keyword.value) for keyword in node.keywords}
            place = f"{where['where']}: " if where.get("where") else ""
            yield f"{place}unknown {rendered(node.args[0])} '…'", "a name that the message offers", where.get("fix", "")
        elif node.func.id == "ValueError" and node.args and declares:
            yield "parameter …", rendered(node.args[0]), ""


def error_tables() -> str:
    """Return one table per package."""
    parts = []
    for package in sorted(path for path in (ROOT / "src").iterdir() if (path / "setup.py").exists()):
        rows = set()
        for path in sorted((package / package.name).rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            rows |= set(raised(tree, declares=path.stem.endswith("params")))
        if rows:
            parts.append(f"### {package.name}\n\n| error | expected | fix |\n|---|---|---|")
            parts[-1] += "".join(
                f"\n| {' | '.join(_cell(text.replace('`', '')) for text in row)} |" for row in sorted(rows)
            )
    return "\n\n".join(parts)


def bringup_table() -> str:
    """Return the table of what `slip-vic bringup` prints where a step does not hold."""
    rules = ROOT / "src/slip_vic/slip_vic/setup/bringup/walk.py"
    lines = ["| judged | what to do |", "|---|---|"]
    for function in ast.walk(ast.parse(rules.read_text(encoding="utf-8"))):
        if isinstance(function, ast.FunctionDef):
            fixes = [rendered(fix) for node in ast.walk(function) for fix in _fixes(node)]
            lines += [
                f"| {function.name.strip('_').removeprefix('judge_')} | {_cell(text)} |"
                for text in fixes
                if text.strip("…")
            ]
    return "\n".join(lines)


def _fixes(node: ast.AST) -> Iterator[ast.expr]:
    """Yield the fixes that a call of `judge` has."""
    match node:
        case ast.Call(func=ast.Name(id="judge"), args=[_, _, _, *faults]):
            yield from (fix for fault in faults for fix in (fault.elts[1:] if isinstance(fault, ast.Tuple) else ()))


def shown(words: str) -> str:
    """Return the words of a reason with … for what is known at run time only."""
    return re.sub(r"\{[^}]*\}", "…", words)


def reason_table() -> str:
    """Return the table of what stands behind the mode, in the order in which it counts."""
    lines = ["| mode | what you see | what to do | code |", "|---|---|---|---|"]
    for reason in Reason:
        if reason.severity != Severity.SAMPLE:
            seen = _cell(shown(reason.words))
            lines.append(f"| {reason.severity.name} | {seen} | {_cell(reason.to_do)} | {reason.name} {reason} |")
    return "\n".join(lines)


def fault_table() -> str:
    """Return the table of what can be wrong with an input."""
    lines = ["| fault | what to do |", "|---|---|"]
    lines += [
        f"| {reason.name.lower().replace('_', ' ')} | {_cell(reason.to_do)} |"
        for reason in Reason
        if reason.severity == Severity.SAMPLE and reason != Reason.NONE
    ]
    return "\n".join(lines)


def sensor_table() -> str:
    """Return the table of mistakes that the readings of a slip sensor show."""
    lines = ["| slip_velocity ... | what to do |", "|---|---|"]
    lines += [f"| {_cell(shown(health.words))} | {_cell(health.to_do)} |" for health in SensorHealth if health.to_do]
    return "\n".join(lines)


def condition_table() -> str:
    """Return the table of docs/safety.md: every condition, in the order in which it counts."""
    lines = ["| condition | mode | lasts | clears by itself |", "|---|---|---|---|"]
    for reason in Reason:
        if reason.severity != Severity.SAMPLE:
            lasts = f"{1e3 * reason.lasts_s:.0f} ms" if reason.lasts_s else ""
            seen = _cell(shown(reason.words))
            lines.append(f"| {seen} | {reason.severity.name} | {lasts} | {'yes' if reason.clears else 'no'} |")
    return "\n".join(lines)


def _cell(text: str) -> str:
    plain = " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")
    return plain or " "


def tables() -> str:
    """Return everything between the marks of the page."""
    return (
        f"{BEGIN}\n\n## Reasons of a mode\n\nOn `controller/mode` and in `/diagnostics`.\n\n{reason_table()}\n\n"
        "## Faults of an input\n\nWhat happens then is in [safety](safety.md#reactions).\n\n"
        f"{fault_table()}\n\n## Mistakes of a slip sensor\n\nIn the mode, in a bring-up and from `slip-vic identify`.\n\n"
        f"{sensor_table()}\n\n## Steps of a bring-up\n\nOne line, exit code 1: the step, what was got, what is expected, and "
        f"what to do. [Bring-up](robot.md#bring-up) has the steps.\n\n{bringup_table()}\n\n## Error texts\n\nOne line, exit code 2: what, what was got, what is expected, the fix. "
        f"… stands for a name or number of yours.\n\n{error_tables()}\n\n{END}"
    )


def page(path: Path, made: str) -> str:
    """Return a whole page, with what is made between its marks."""
    text = path.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    return before + made + rest.partition(END)[2]


def pages() -> dict[Path, str]:
    """Return every page that has a part made here."""
    conditions = f"{BEGIN}\n\n{condition_table()}\n\n{END}"
    return {PAGE: page(PAGE, tables()), SAFETY: page(SAFETY, conditions)}


if __name__ == "__main__":
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")
