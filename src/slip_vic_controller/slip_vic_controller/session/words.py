"""The words of a reason with its fields filled in, and the fields as they are published."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.safety.conditions import Reason, Why, WhyRecord
from slip_vic_controller.sizes import MAX_CONTACTS

MISSING = (
    *("activation", "a good joint state{it}", "joint_states"),
    *(f"{name} of contact {k}" for name in ("wrench", "slip") for k in range(MAX_CONTACTS)),
)
SENSORS = (
    *("the slip sensor [m/s]", "the slip sensor [rad/s]", "the wrench sensor [N]", "the wrench sensor [N m]"),
    "the joint velocity [rad/s]",
)
MISTAKES = tuple(health.words for health in SensorHealth)


def describe(why: Why | WhyRecord | Any, joint_names: Sequence[str]) -> str:
    """Return the words for it; an empty text where there is nothing."""
    fault = Reason(why.fault).words
    text = Reason(why.reason).words.format(
        value=why.value,
        limit=why.limit,
        which=why.which,
        joint=_name(why.which, joint_names),
        fault=fault,
        missing=", ".join(
            word.format(it=f" (it {fault})" if fault else "")
            for bit, word in enumerate(MISSING)
            if why.which >> bit & 1
        ),
        mistake=_word(MISTAKES, why.which).format(value=why.value, limit=why.limit),
        sensor=_word(SENSORS, why.which),
    )
    return f"resumes after: {text}" if why.over else text


def reason_fields(why: Any, joint_names: Sequence[str]) -> dict[str, object]:
    """Return the published fields beside the text: name and number, the fault of an input, and the numbers."""
    reason = Reason(why.reason)
    return {
        "reason": reason.name,
        "reason_number": reason.value,
        "fault": Reason(why.fault).name,
        "which": _name(why.which, joint_names) if "{joint}" in reason.words else why.which,
        "value": f"{why.value:.6g}",
        "limit": f"{why.limit:.6g}",
    }


def _word(words: Sequence[str], k: int) -> str:
    return words[k] if 0 <= k < len(words) else ""


def _name(joint: int, joint_names: Sequence[str]) -> str:
    return "the pad" if joint < 0 else _word(joint_names, joint)
