"""Everything that can be wrong with an input, and the reaction to it: one table for code, documentation and tests."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType
from typing import NamedTuple


class Trouble(IntEnum):
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


class Reaction(NamedTuple):
    """What happens: to the sample, and to the mode."""

    found_by: str
    sample: str
    mode: str


_BRIDGED = "the last effort is repeated for `inputs.bridge_s`, then HOLD from the last good position"
_AGE = "none by itself; the age limit decides"
_AHEAD = "stamp more than `inputs.future_s` ahead of the joint state: two clocks, or joint states that come late"
_LADDER = "slip ladder: observer alone, then slow down along the path, then HOLD"

# (input, trouble) -> reaction. "any" stands for all three inputs.
REACTIONS: Mapping[tuple[str, Trouble], Reaction] = MappingProxyType(
    {
        ("any", Trouble.NEVER_SEEN): Reaction("no good sample yet", "-", "WAITING_INPUT, no effort"),
        ("any", Trouble.REFUSED): Reaction(
            "wrong type, joint names, sizes or frame_id", "dropped; permuted names are put in order", _AGE
        ),
        ("any", Trouble.DENORMAL): Reaction(
            "a number below the smallest normal one", "used", "none: no formula divides by it"
        ),
        ("any", Trouble.OUT_OF_ORDER): Reaction("stamp before that of the last good sample", "dropped", _AGE),
        ("any", Trouble.DUPLICATE): Reaction("stamp of the last good sample", "dropped, not answered", _AGE),
        ("any", Trouble.SECOND_PUBLISHER): Reaction("two publishers on the topic", "used", "HOLD while they are two"),
        ("joint state", Trouble.NOT_FINITE): Reaction("NaN or infinity", "not used", _BRIDGED),
        ("joint state", Trouble.ABSURD): Reaction("far beyond the URDF's limits", "not used", _BRIDGED),
        ("joint state", Trouble.JUMP): Reaction(
            "a position that the velocities do not explain", "not used, until `inputs.accept_after` agree", _BRIDGED
        ),
        ("joint state", Trouble.CLOCK_JUMP): Reaction(
            "a stamp that the time that passed does not explain",
            "dropped, not answered, until `inputs.accept_after` agree",
            "HOLD after the age limit",
        ),
        ("joint state", Trouble.RESTARTED): Reaction(
            "`inputs.accept_after` samples agree after a jump of clock or position",
            "used",
            "everything starts anew: WAITING_INPUT, then the trajectory from here",
        ),
        ("joint state", Trouble.SILENT): Reaction(
            "nothing for `inputs.joint.age_s` on the steady clock", "-", "HOLD: efforts go to gravity compensation"
        ),
        ("joint state", Trouble.FROZEN): Reaction(
            "equal to the last bit for `inputs.joint.frozen_s` while motion is wanted", "used", "HOLD"
        ),
        ("joint state", Trouble.NOT_RUN): Reaction(
            "the controller itself did not run for `inputs.joint.age_s`", "used", "HOLD, then resumes"
        ),
        ("joint state", Trouble.LATE): Reaction(
            "`inputs.joint.late_s` more between stamp and answer than at best, `inputs.accept_after` times in a row",
            "used",
            "HOLD, softer the later they are; a clock that was set back: until `~/enable`",
        ),
        ("wrench", Trouble.NOT_FINITE): Reaction("NaN or infinity", "dropped", _AGE),
        ("wrench", Trouble.ABSURD): Reaction("above `inputs.wrench.force`, `torque`", "dropped", _AGE),
        ("wrench", Trouble.FUTURE): Reaction(_AHEAD, "dropped", "HOLD from the second in a row on"),
        ("wrench", Trouble.SILENT): Reaction("nothing for `inputs.wrench.age_s`", "-", "HOLD"),
        ("wrench", Trouble.STALE): Reaction("newest stamp older than `inputs.wrench.age_s`", "not used", "HOLD"),
        ("wrench", Trouble.FROZEN): Reaction(
            "equal to the last bit for `inputs.wrench.frozen_s` while the arm moves", "not used", "HOLD"
        ),
        ("slip", Trouble.INVALID): Reaction("the sensor says so: NaN", "not used", _LADDER),
        ("slip", Trouble.ABSURD): Reaction("above `inputs.slip.linear`, `angular`", "dropped", _AGE),
        ("slip", Trouble.FUTURE): Reaction(_AHEAD, "dropped", f"from the second in a row on {_LADDER}"),
        ("slip", Trouble.SILENT): Reaction("nothing for `inputs.slip.age_s`", "-", _LADDER),
        ("slip", Trouble.STALE): Reaction("newest stamp older than `inputs.slip.age_s`", "not used", _LADDER),
        ("slip", Trouble.FROZEN): Reaction(
            "not zero and equal to the last bit for `inputs.slip.frozen_s`", "not used", _LADDER
        ),
        ("slip", Trouble.IMPLAUSIBLE): Reaction(
            "none, while wrench and motion show `fallback.evidence`", "not used", _LADDER
        ),
        ("effort command", Trouble.FOREIGN_COMMAND): Reaction("another publisher on our topic", "-", "FAULT"),
    }
)

WORDS: Mapping[Trouble, str] = MappingProxyType(
    {
        Trouble.NEVER_SEEN: "has never been seen",
        Trouble.REFUSED: "is refused",
        Trouble.NOT_FINITE: "is not finite",
        Trouble.ABSURD: "is absurdly large",
        Trouble.DENORMAL: "has denormal numbers",
        Trouble.OUT_OF_ORDER: "is out of order",
        Trouble.DUPLICATE: "comes twice",
        Trouble.FUTURE: "is ahead of the joint state",
        Trouble.JUMP: "has jumped",
        Trouble.CLOCK_JUMP: "has a stamp that has jumped",
        Trouble.RESTARTED: "comes from a source that has started anew",
        Trouble.SILENT: "is silent",
        Trouble.STALE: "is too old",
        Trouble.FROZEN: "is frozen",
        Trouble.INVALID: "is invalid",
        Trouble.IMPLAUSIBLE: "contradicts the wrench",
        Trouble.SECOND_PUBLISHER: "has two publishers",
        Trouble.FOREIGN_COMMAND: "is published by somebody else too",
        Trouble.NOT_RUN: "was not answered for too long",
        Trouble.LATE: "is late",
    }
)


def say(name: str, trouble: Trouble) -> str:
    """Return the phrase for a reason, an empty text where there is no trouble.

    Implements: ours: one wording for topics, diagnostics and tests.
    """
    return f"{name} {WORDS[trouble]}" if trouble != Trouble.NONE else ""


def reaction_table() -> str:
    """Return the table for the documentation.

    Implements: ours: the page says what the code does.
    """
    lines = ["| input | what is wrong | found by | the sample | the mode |", "|---|---|---|---|---|"]
    for (name, trouble), row in REACTIONS.items():
        words = trouble.name.lower().replace("_", " ")
        lines.append(f"| {name} | {words} | {row.found_by} | {row.sample} | {row.mode} |")
    return "\n".join(lines)
