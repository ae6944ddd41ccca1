"""The governor's backward pass in one go, which a control cycle never does: a share of its points is done in each."""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import OUT1, REAL, VOID, kernel
from slip_core.records import record
from slip_vic_controller.governor.backward_pass import step_back
from slip_vic_controller.state import TASK_SIZE, TASK_STATE


@kernel(VOID(OUT1, REAL))
def whole_pass(state: Array, F: float) -> None:
    """Do the backward pass over every point of the path that a controller is on.

    Args:
        state: of a governed controller whose path is known.
        F: load that may be asked [N].
    """
    grid = record(state[:TASK_SIZE], TASK_STATE).grid
    for k in range(grid.points.shape[0]):
        step_back(grid, grid.points.shape[0] - 1 - k, F, 0.0, True)
