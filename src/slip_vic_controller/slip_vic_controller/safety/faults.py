"""Everything that can be wrong with an input, and the reaction to it: one table for code, documentation and tests."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum, unique
from types import MappingProxyType
from typing import NamedTuple


@unique
class Fault(IntEnum):
    """What is wrong with a sample or an input; the numbers are part of the ledger's format."""

    NONE = 0
    NEVER_SEEN = 1
    REFUSED = 2  # joint names, sizes, frame_id, not a message of the type
    NOT_FINITE = 3
    ABSURD = 4
    DENORMAL = 5
    OUT_OF_ORDER = 6
    DUPLICATE = 7
    FUTURE = 8
    CLOCK_JUMP = 9
    JUMP = 10
    RESTARTED = 11
    SILENT = 12
    STALE = 13
    FROZEN = 14
    INVALID = 15
    IMPLAUSIBLE = 16
    SECOND_PUBLISHER = 17
    FOREIGN_COMMAND = 18
    NOT_RUN = 19
    LATE = 20
    OTHER_ARM = 21


FAULTS = len(Fault)


@unique
class Input(IntEnum):
    """What a fault is said of."""

    JOINT_STATE = 0
    WRENCH = 1
    SLIP = 2
    EFFORT_COMMAND = 3
    ANY = 4


INPUT_WORDS: Mapping[Input, str] = MappingProxyType(
    {
        Input.JOINT_STATE: "joint state",
        Input.WRENCH: "wrench",
        Input.SLIP: "slip velocity",
        Input.EFFORT_COMMAND: "effort command",
        Input.ANY: "an input",
    }
)


class Reaction(NamedTuple):
    """What happens: to the sample, and to the mode."""

    found_by: str
    sample: str
    mode: str


_BRIDGED = (
    "the law goes on where the model has the arm, after `inputs.bridge_s` DEGRADED: the path comes to rest, after "
    "0.45 s HOLD, after 0.5 s no command"
)
_STOPPING = (
    "DEGRADED: the path comes to rest, for twice `fallback.slow_down_s`, with the wrench of the model; then HOLD"
)
_AGE = "none by itself; the age limit decides"
_AHEAD = "stamp more than 50 ms ahead of the joint state: two clocks, or joint states that come late"
_DEGRADED = "DEGRADED: observer alone, then slow down along the path; then HOLD"

# (input, fault) -> reaction. "any" stands for all three inputs.
REACTIONS: Mapping[tuple[str, Fault], Reaction] = MappingProxyType(
    {
        ("any", Fault.NEVER_SEEN): Reaction("no good sample yet", "-", "WAITING_INPUT, no effort"),
        ("any", Fault.REFUSED): Reaction(
            "wrong type, joint names, sizes or frame_id", "dropped; permuted names are put in order", _AGE
        ),
        ("any", Fault.DENORMAL): Reaction(
            "a number below the smallest normal one", "used", "none: no formula divides by it"
        ),
        ("any", Fault.OUT_OF_ORDER): Reaction("stamp before that of the last good sample", "dropped", _AGE),
        ("any", Fault.DUPLICATE): Reaction("stamp of the last good sample", "dropped, not answered", _AGE),
        ("any", Fault.SECOND_PUBLISHER): Reaction("two publishers on the topic", "used", "HOLD while they are two"),
        ("joint state", Fault.NOT_FINITE): Reaction("NaN or infinity", "not used", _BRIDGED),
        ("joint state", Fault.ABSURD): Reaction("far beyond the URDF's limits", "not used", _BRIDGED),
        ("joint state", Fault.JUMP): Reaction(
            "a position that the velocities do not explain", "not used, until five agree", _BRIDGED
        ),
        ("joint state", Fault.CLOCK_JUMP): Reaction(
            "a stamp that the time that passed does not explain",
            "dropped, not answered, until five agree",
            "HOLD after the age limit",
        ),
        ("joint state", Fault.RESTARTED): Reaction(
            "five samples agree after a jump of clock or position; or a pause and a jump of position",
            "used",
            "everything restarts: WAITING_INPUT, then the trajectory from here",
        ),
        ("joint state", Fault.SILENT): Reaction(
            "nothing for `inputs.joint.age_s` on the steady clock", "-", "HOLD: efforts go to gravity compensation"
        ),
        ("joint state", Fault.FROZEN): Reaction(
            "equal to the last bit for `inputs.frozen_s` while motion is wanted or measured",
            "where it cannot be, the model's instead",
            f"{_BRIDGED}; until it changes or `~/enable`",
        ),
        ("joint state", Fault.NOT_RUN): Reaction(
            "the controller itself did not run for `inputs.joint.age_s`", "used", "HOLD, then resumes"
        ),
        ("joint state", Fault.LATE): Reaction(
            "`inputs.joint.late_s` more between stamp and answer than at best, five times in a row",
            "used",
            "HOLD, softer the later they are; a clock that was set back: until `~/enable`",
        ),
        ("wrench", Fault.NOT_FINITE): Reaction("NaN or infinity", "dropped", _AGE),
        ("wrench", Fault.ABSURD): Reaction("above `inputs.wrench.force`, `torque`", "dropped", _AGE),
        ("wrench", Fault.INVALID): Reaction(
            "all numbers zero, `wrench.zero_after` samples in a row", "not used", _STOPPING
        ),
        ("wrench", Fault.FUTURE): Reaction(_AHEAD, "dropped", "from the second in a row on: HOLD"),
        ("wrench", Fault.SILENT): Reaction("nothing for `inputs.wrench.age_s`", "-", _STOPPING),
        ("wrench", Fault.STALE): Reaction("newest stamp older than `inputs.wrench.age_s`", "not used", _STOPPING),
        ("wrench", Fault.FROZEN): Reaction(
            "equal to the last bit for `inputs.frozen_s` while the arm moves",
            "the model's instead, unless it shows that the object is gone",
            f"{_STOPPING}; until it changes or `~/enable`",
        ),
        ("slip", Fault.INVALID): Reaction("the sensor reports NaN", "not used", _DEGRADED),
        ("slip", Fault.ABSURD): Reaction("above `inputs.slip.linear`, `angular`", "dropped", _AGE),
        ("slip", Fault.FUTURE): Reaction(_AHEAD, "dropped", f"from the second in a row on: {_DEGRADED}"),
        ("slip", Fault.SILENT): Reaction("nothing for `inputs.slip.age_s`", "-", _DEGRADED),
        ("slip", Fault.STALE): Reaction("newest stamp older than `inputs.slip.age_s`", "not used", _DEGRADED),
        ("slip", Fault.FROZEN): Reaction(
            "not zero and equal to the last bit for `inputs.frozen_s`", "not used", _DEGRADED
        ),
        ("slip", Fault.IMPLAUSIBLE): Reaction(
            "none, while wrench and motion show `fallback.evidence`, for 50 ms beyond its delay", "not used", _DEGRADED
        ),
        ("any", Fault.OTHER_ARM): Reaction(
            "the other arm on the same object does not follow the law", "used", "HOLD, both in the same cycle"
        ),
        ("effort command", Fault.FOREIGN_COMMAND): Reaction("another publisher on our topic", "-", "FAULT"),
    }
)

WORDS: Mapping[Fault, str] = MappingProxyType(
    {
        Fault.NEVER_SEEN: "has never been seen",
        Fault.REFUSED: "is refused",
        Fault.NOT_FINITE: "is not finite",
        Fault.ABSURD: "is absurdly large",
        Fault.DENORMAL: "has denormal numbers",
        Fault.OUT_OF_ORDER: "is out of order",
        Fault.DUPLICATE: "comes twice",
        Fault.FUTURE: "is ahead of the joint state",
        Fault.JUMP: "has jumped",
        Fault.CLOCK_JUMP: "has a stamp that has jumped",
        Fault.RESTARTED: "comes from a source that has restarted",
        Fault.SILENT: "is silent",
        Fault.STALE: "is too old",
        Fault.FROZEN: "is frozen",
        Fault.INVALID: "is invalid",
        Fault.IMPLAUSIBLE: "contradicts the wrench",
        Fault.SECOND_PUBLISHER: "has two publishers",
        Fault.FOREIGN_COMMAND: "has another publisher",
        Fault.NOT_RUN: "was not answered for too long",
        Fault.LATE: "is late",
        Fault.OTHER_ARM: "of the other arm on this object has stopped it",
    }
)


def describe_fault(of: Input, fault: Fault) -> str:
    """Return the phrase for a reason, an empty text where there is no fault."""
    return f"{INPUT_WORDS[of]} {WORDS[fault]}" if fault != Fault.NONE else ""


def reaction_table() -> str:
    """Return the table for the documentation."""
    lines = ["| input | what is wrong | found by | the sample | the mode |", "|---|---|---|---|---|"]
    for (name, fault), row in REACTIONS.items():
        words = fault.name.lower().replace("_", " ")
        lines.append(f"| {name} | {words} | {row.found_by} | {row.sample} | {row.mode} |")
    return "\n".join(lines)
