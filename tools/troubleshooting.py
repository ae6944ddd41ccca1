"""Write the tables of docs/troubleshooting.md: reasons of a mode, faults, steps of a bring-up, error texts, from the sources.

python tools/troubleshooting.py          # writes the page between its marks again
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from slip_vic_controller.safety.faults import Fault
from slip_vic_controller.safety.reasons import Cause, Reason, describe

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "troubleshooting.md"
ERRORS = ("InputError", "ProtocolError", "RefusedByChild", "MixedVersions", "DivergenceError")
BEGIN, END = "<!-- begin: made by tools/troubleshooting.py -->", "<!-- end -->"

TO_DO = {
    Cause.NO_INPUT_YET: "Start the drivers. `slip-vic bag record -a` and `bag info` show what is missing.",
    Cause.WAITS: "The reason names the topics. Remap your driver's topics to these names, and compare `frame_id` and QoS.",
    Cause.NOT_ENABLED: "Call `~/enable`, or set `safety.auto_enable`.",
    Cause.ASKED: "A user called `~/hold`. `~/enable` ends it.",
    Cause.STOPPING: "Wait: it comes to rest along the path first.",
    Cause.INPUT: "See the fault below; the input is named before it.",
    Cause.PREDICTED: "The slip sensor has a fault; the observer continues for `safety.fallback.observer_s`. See the fault below.",
    Cause.SLOWING: "As before, and that time is over: fix the slip sensor; it then continues by itself.",
    Cause.SLIDES: "More grip, or a slower path. The law begins when the object is at rest in the grasp.",
    Cause.JOINT_TOO_FAST: "Find what made the joint run: a wrong sign or frame of the wrench, gains too high for a delay. Then "
    "`~/reset_fault` and `~/enable`.",
    Cause.PAD_TOO_FAST: "As for a joint that is too fast.",
    Cause.PAD_TURNS_TOO_FAST: "As for a joint that is too fast.",
    Cause.FALLS: "The object slips out: more grip. Where it does not, `object.mass` or the friction is wrong.",
    Cause.SATURATED: "The law needs more than the joints have: a slower path, or the governor; see safety.md for "
    "`safety.limits.effort_rate`.",
    Cause.PATH_WAITS: "The arm does not follow: something blocks it, or the gains are too soft for the path.",
    Cause.OLD_JOINT_STATE: "Two drivers publish, or stamps go back. Look at `ros2 topic info -v` of the joint states.",
    Cause.BAD_REFERENCE: "The node that publishes `reference` sends NaN or infinity.",
    Cause.NO_ESTIMATE: "Report it with a bag: the observer must give a finite estimate for all inputs.",
    Cause.NO_TORQUE: "The arm is in a singular posture or a limit is reached: move it away by hand, then `~/reset_fault`.",
    Cause.TARE: "Wait: it takes `tare.duration_s`, and restarts where a joint moves. Nothing may touch the arm or the object.",
    Cause.BIASED: "Zero the named sensor, or fix it; then `~/tare`. Where the bias is its own, raise `tare.*`.",
    Cause.MOVED_IN_TARE: "Clear the arm. Check `object.mass`, the masses of the URDF, `effort.gravity` and the drives' torque offsets; then `~/reset_fault`.",
    Cause.TOO_HEAVY: "The drives hold the arm until it can be held: correct `object.mass` or the URDF's effort limits, or start elsewhere; then `~/enable`.",
    Cause.NOT_FOLLOWING: "Release the joint's brake, clear the arm, or raise `disturbance.limit`: its friction is above the effort. "
    "`slip-vic identify` measures friction.",
    Cause.RANGE_END: "The path takes the joint farther than it goes: start in another posture (`slip-vic arm FILE` finds one), or shorten it.",
    Cause.NOT_TURNING: "As for a pad that is off its place.",
    Cause.RANGE_END_TURNED: "As for a pad that is off its place.",
    Cause.PUSHED_BACK: "As for a joint at the end of its range.",
    Cause.INTERNAL: "Report it with a bag and the line in the node's log.",
    Cause.PATH_TOO_HEAVY: "More grip, a lighter object, or another attitude: at that place friction cannot carry the weight. Where the "
    "object was pushed, friction is more than what that slip has taught: `~/reset_fault` plans with the configured friction.",
    Cause.OVERRUNS: "The friction fell while it moved. More grip; `governor.margin` leaves more room.",
    Cause.ENDLESS_SLIP: "Pads tremble with the joints, or a bias came after the tare: `~/tare` at rest, or a larger `governor.pre_sliding`.",
    Cause.CONTRADICTS: "Look at the slip sensor: it reads zero, not this contact, or on other axes than those of the pad. Where it is right, "
    "`object.mass` is larger than the object's, or the wrench reads too little: call `~/tare` at rest. `~/reset_fault` begins again with "
    "the configured friction.",
    Cause.JOINT: "Check this joint's encoder, its sign and its driver; after a collision clear the arm. Where efforts are "
    "late set `drive.delay_s`. Then `~/reset_fault`.",
    Cause.GIVEN_UP: "Object or contact differ from the configuration: check `object.mass`, `contacts.position` and the wrench's frame.",
}
"""What a user does about a reason."""

FAULT_TO_DO = {
    Fault.NEVER_SEEN: "Start the sensor; compare topic name, type and QoS.",
    Fault.REFUSED: "Compare joint names, sizes and `frame_id` with the parameters.",
    Fault.NOT_FINITE: "The driver sends NaN: a fault of its own, or a division by zero.",
    Fault.ABSURD: "Wrong unit (mm, N mm, degrees)? Else raise `safety.inputs.*`.",
    Fault.DENORMAL: "Nothing: it is used.",
    Fault.OUT_OF_ORDER: "Two publishers, or a driver that stamps at random.",
    Fault.DUPLICATE: "A driver that repeats samples; harmless while new ones come too.",
    Fault.FUTURE: "Two clocks: synchronise them (chrony, ptp).",
    Fault.CLOCK_JUMP: "The clock was set. Wait, or use a clock that slews.",
    Fault.JUMP: "Joint encoders jumped, or the driver lost samples.",
    Fault.RESTARTED: "Nothing: the driver was restarted, and the trajectory begins from here.",
    Fault.SILENT: "The driver stopped, or the network did.",
    Fault.STALE: "Samples arrive with old stamps: latency of the driver.",
    Fault.FROZEN: "The sensor repeats itself: power, cable, or a quantum larger than what is measured.",
    Fault.INVALID: "The sensor reports that it cannot measure: light, contact, calibration.",
    Fault.SECOND_PUBLISHER: "The reason names the topic: stop one of them.",
    Fault.FOREIGN_COMMAND: "Another controller commands the arm: stop it, then `~/reset_fault`.",
    Fault.NOT_RUN: "The computer was busy: real-time priority (`--fifo`), a free core (`--cpu`).",
    Fault.LATE: "Stamps and arrivals drift apart: clock, network or a full queue.",
    Fault.OTHER_ARM: "Look at the other arm's mode and reason: both stop and continue together.",
}
"""What a user does about a fault of an input."""


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
    rules = ROOT / "src/slip_vic/slip_vic/setup/bringup/verdicts.py"
    lines = ["| judged | what to do |", "|---|---|"]
    for function in ast.parse(rules.read_text(encoding="utf-8")).body:
        if isinstance(function, ast.FunctionDef):
            fixes = [rendered(fix) for node in ast.walk(function) for fix in _fixes(node)]
            lines += [
                f"| {function.name.strip('_').removeprefix('judge_')} | {_cell(text)} |" for text in fixes if text
            ]
    return "\n".join(lines)


def _fixes(node: ast.AST) -> Iterator[ast.expr]:
    """Yield the fixes that a call of `judge` has."""
    match node:
        case ast.Call(func=ast.Name(id="judge"), args=[_, _, _, *faults]):
            yield from (fix for fault in faults for fix in (fault.elts[1:] if isinstance(fault, ast.Tuple) else ()))


def reason_table() -> str:
    """Return the table of what stands behind the mode."""
    joints = ("JOINT",)
    lines = ["| what you see | what to do | code |", "|---|---|---|"]
    for cause in Cause:
        if cause == Cause.NONE:
            continue
        words = describe(Reason(cause, 0, 0, 0.0, 0.0), joints)
        shown = re.sub(r"\d+\.\d+", "…", words or "the input and its fault")
        lines.append(f"| {_cell(shown)} | {_cell(TO_DO[cause])} | {cause.name} |")
    return "\n".join(lines)


def fault_table() -> str:
    """Return the table of what can be wrong with an input."""
    lines = ["| fault | what to do |", "|---|---|"]
    lines += [
        f"| {fault.name.lower().replace('_', ' ')} | {_cell(FAULT_TO_DO[fault])} |"
        for fault in Fault
        if fault != Fault.NONE
    ]
    return "\n".join(lines)


def _cell(text: str) -> str:
    plain = " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")
    return plain or " "


def tables() -> str:
    """Return everything between the marks of the page."""
    return (
        f"{BEGIN}\n\n## Reasons of a mode\n\nOn `controller/mode` and in `/diagnostics`.\n\n{reason_table()}\n\n"
        "## Faults of an input\n\nWhat happens then is in [safety](safety.md#reactions).\n\n"
        f"{fault_table()}\n\n## Steps of a bring-up\n\nOne line, exit code 1: the step, what was got, what is expected, and "
        f"what to do. [Bring-up](robot.md#bring-up) has the steps.\n\n{bringup_table()}\n\n## Error texts\n\nOne line, exit code 2: what, what was got, what is expected, the fix. "
        f"… stands for a name or number of yours.\n\n{error_tables()}\n\n{END}"
    )


def page() -> str:
    """Return the whole page."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    return before + tables() + rest.partition(END)[2]


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
