"""What to do while slip is not known: never as if there were none.

OBSERVED  the observer predicts slip from the wrench alone, for a bounded time
SLOWING   the path comes to rest; the law goes on with the prediction, or without compensation where there is none
HOLD      joint-space hold
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple


class Rung(IntEnum):
    """Rungs of the ladder, downwards."""

    MEASURED = 0
    OBSERVED = 1
    SLOWING = 2
    HOLD = 3


class LadderPolicy(NamedTuple):
    """observer_ns: how long the observer may run alone, 0 where there is none; slow_down_ns: time to come to rest."""

    observer_ns: int
    slow_down_ns: int


class LadderState(NamedTuple):
    """Since when slip is unknown, None where it is known."""

    since_ns: int | None = None


def descend(state: LadderState, unknown: str, now_ns: int, policy: LadderPolicy) -> tuple[LadderState, Rung, str]:
    """Return the next state, the rung, and what to say; `unknown` says why slip is not known, empty where it is.

    Implements: ours: a bounded time on each rung, from the moment slip became unknown.
    """
    if not unknown:
        return LadderState(), Rung.MEASURED, ""
    since = now_ns if state.since_ns is None else state.since_ns
    passed = now_ns - since
    if passed < policy.observer_ns:
        return LadderState(since), Rung.OBSERVED, f"{unknown}: predicting it from the wrench"
    if passed < policy.observer_ns + policy.slow_down_ns:
        return LadderState(since), Rung.SLOWING, f"{unknown}: slowing down"
    return LadderState(since), Rung.HOLD, unknown
