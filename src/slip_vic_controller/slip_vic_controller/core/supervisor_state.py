"""What the supervision remembers from cycle to cycle, and what a cycle gives."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_core.arrays import Array, readonly
from slip_core.types import EffortCommand
from slip_vic_controller.core.diagnostics import TickDiagnostics
from slip_vic_controller.core.fallback import LadderState
from slip_vic_controller.core.guard_kernel import WATCHED
from slip_vic_controller.core.lateness import Lateness
from slip_vic_controller.core.modes import ModeState
from slip_vic_controller.core.output_gate import GateState
from slip_vic_controller.core.path_time import PathTime
from slip_vic_controller.core.state import ControllerState


class SupervisorState(NamedTuple):
    """The memory of the supervision; (n,) arrays, None before there is anything to remember.

    mode; gate; ladder; path; posture: that HOLD keeps [rad]; now_ns: of the last cycle; joint_bad_since_ns;
    contradicted_since_ns, fast_since_ns, saturated_since_ns, stopping_since_ns; watched: what the last evaluation of
    the law looked like, packed as in `guard_kernel`, UNWATCHED before there is one; load_error: what HOLD adds to the
    model's load (6,) {ee}; lateness: of the joint states.
    """

    mode: ModeState
    gate: GateState | None
    ladder: LadderState
    path: PathTime
    posture: Array | None
    now_ns: int
    joint_bad_since_ns: int | None
    contradicted_since_ns: int | None
    fast_since_ns: int | None
    saturated_since_ns: int | None
    stopping_since_ns: int | None
    watched: Array
    load_error: Array
    lateness: Lateness


class Supervised(NamedTuple):
    """One cycle: command, memories, the record of the tick, and which joints were at the rate limit (n,)."""

    command: EffortCommand
    control: ControllerState
    state: SupervisorState
    diagnostics: TickDiagnostics
    limited: NDArray[np.bool_]


UNWATCHED = readonly([0.0, 1.0, *([0.0] * (WATCHED - 2))])
NO_ERROR = readonly(np.zeros(6))
