"""Everything that can be wrong with an input, and its words."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum, unique
from types import MappingProxyType


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
    SECOND_PUBLISHER = 17
    FOREIGN_COMMAND = 18
    NOT_RUN = 19
    LATE = 20
    OTHER_ARM = 21


FAULTS = max(Fault) + 1
"""Length of an array with a place per fault."""


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
