"""What the drives make of a commanded effort, compiled; plain form: `simulation.driven_effort`."""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import IN1, INT, OUT1, REAL, kernel

OBEYED, CLIPPED, NOT_FINITE = 0, 1, 2


@kernel(INT(IN1, IN1, REAL, IN1, OUT1))
def drive(wanted: Array, last: Array, largest_change: float, limit: Array, out: Array) -> int:
    """Write the applied effort to `out`; return `OBEYED`, `CLIPPED` by the limits, or `NOT_FINITE`.

    wanted, last, limit, out (n,) [N m]; largest_change [N m] from the last effort to this one, inf where unbounded.

    Implements: ours: `driven_effort` in one call.
    """
    outcome = OBEYED
    for i in range(len(wanted)):
        effort = wanted[i]
        if not math.isfinite(effort):
            return NOT_FINITE
        effort = min(max(effort, last[i] - largest_change), last[i] + largest_change)
        out[i] = min(max(effort, -limit[i]), limit[i])
        if out[i] != effort:
            outcome = CLIPPED
    return outcome
