"""The one last gate that every command passes: finite, inside the effort limits, no faster than the rate limit.

By induction: the effort before is finite and inside the limits, so what comes out is too, whatever was wanted.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_core.arrays import Array, readonly
from slip_vic_controller.core.safety import finite

NS = 1e-9


class GateLimits(NamedTuple):
    """effort (n,) [N m], of every joint; rate [N m/s]; longest_step_ns, restart_after_ns: see the parameters."""

    effort: Array
    rate: float
    longest_step_ns: int
    restart_after_ns: int


class GateState(NamedTuple):
    """The effort that left the gate last (n,) [N m], and when."""

    effort: Array
    now_ns: int


class GateResult(NamedTuple):
    """What leaves the gate: effort (n,) [N m]; clipped, limited (n,): joints at the effort and at the rate limit.

    refused: True where what was wanted was not finite or had the wrong size, and the last effort went out again.
    """

    effort: Array
    clipped: NDArray[np.bool_]
    limited: NDArray[np.bool_]
    refused: bool
    state: GateState


def start_gate(limits: GateLimits, measured: Array | None, gravity: Array, now_ns: int) -> GateState:
    """Return the state from which the first command, or the first after a pause, is limited; (n,) [N m].

    The measured effort is what the joints feel now. Where there is none (not finite, of another size, or all zero,
    which a driver without torque sensors publishes) it is gravity compensation.

    Implements: ours: a restart makes no torque step.
    """
    known = measured is not None and measured.shape == limits.effort.shape and finite(measured) and measured.any()
    start = measured if known and measured is not None else gravity if finite(gravity) else np.zeros_like(limits.effort)
    return GateState(readonly(np.minimum(np.maximum(start, -limits.effort), limits.effort)), now_ns)


def pass_gate(limits: GateLimits, state: GateState, wanted: Array, now_ns: int) -> GateResult:
    """Return the effort to publish at `now_ns` where `wanted` is asked for; (n,) [N m].

    The step since the last command is at most rate * min(time passed, longest step): the same slope at every control
    rate. A clock that goes back allows no step.

    Implements: ours: finite, clipped, slope-limited, in this order. The plain form of `guard_kernel.guard`.
    """
    refused = wanted.shape != limits.effort.shape or not finite(wanted)
    if refused:
        wanted = state.effort
    inside = np.minimum(np.maximum(wanted, -limits.effort), limits.effort)
    step = largest_step(limits, state, now_ns)
    effort = np.minimum(np.maximum(inside, state.effort - step), state.effort + step)
    # Where the rate does not bind this is `inside` to the last bit. Rounding may not carry it over the effort limit.
    effort = np.minimum(np.maximum(effort, -limits.effort), limits.effort)
    limited = effort != inside
    effort.setflags(write=False)
    return GateResult(effort, inside != wanted, limited, refused, GateState(effort, max(now_ns, state.now_ns)))


def largest_step(limits: GateLimits, state: GateState, now_ns: int) -> float:
    """Return by how much an effort may differ at `now_ns` from the last one [N m].

    Implements: ours: the same slope at every control rate, and none for a clock that goes back.
    """
    return limits.rate * NS * min(max(now_ns - state.now_ns, 0), limits.longest_step_ns)


def needs_restart(limits: GateLimits, state: GateState | None, now_ns: int) -> bool:
    """Return whether the last command is so old that the joints may feel something else by now.

    Implements: ours: a bridge or drive stops on its own when commands stay away.
    """
    return state is None or now_ns - state.now_ns > limits.restart_after_ns
