"""The governor's backward pass alone."""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import OUT1, REAL, VOID, kernel
from slip_core.records import record
from slip_vic_controller.governor.plan import backward_pass
from slip_vic_controller.state import TASK_SIZE, TASK_STATE


@kernel(VOID(OUT1, REAL))
def whole_pass(state: Array, F: float) -> None:
    """Do the backward pass over every point of the path that a controller is on.

    Args:
        state: of a governed controller whose path is known.
        F: load that may be asked [N].
    """
    grid = record(state[:TASK_SIZE], TASK_STATE).grid
    backward_pass(grid, F, 0.0, True)
