"""What a cycle leaves behind for a replay: its stamps, its mode, and on what it was decided."""

from __future__ import annotations

from slip_core.compiled import part
from slip_core.records import WholeArray
from slip_vic_controller.cycle.governing import put_governed
from slip_vic_controller.state import ArmState, ControllerConfig, CycleInputs, CycleOutputs, TaskState


@part
def put_time(ledger: WholeArray, at: int, time_ns: int) -> None:
    """Write a time [ns] as seconds and nanoseconds."""
    ledger[at], ledger[at + 1] = time_ns // 1_000_000_000, time_ns % 1_000_000_000


@part
def end_cycle(
    config: ControllerConfig, task: TaskState, state: ArmState, inputs: CycleInputs, outputs: CycleOutputs
) -> None:
    """Write mode and the end of the ledger."""
    outputs.mode = state.mode
    outputs.path_scale, outputs.grip = task.path.scale, state.grip.command
    put_governed(config, task, state, outputs.governor)
    at, h = 3 + 4 * config.law.contacts, outputs.health
    put_time(outputs.ledger, at, inputs.now_ns)
    outputs.ledger[at + 2] = state.mode.mode
    outputs.ledger[at + 3] = h.joint | h.wrench << 8 | h.slip << 16 | h.outside << 24
    outputs.ledger[at + 4], outputs.ledger[at + 5] = inputs.request, task.taken
