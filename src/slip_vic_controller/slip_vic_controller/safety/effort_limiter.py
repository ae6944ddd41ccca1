"""The one last step that every command passes: finite, inside the effort limits, no faster than the rate limit.

By induction: the effort before is finite and inside the limits, so what comes out is too, whatever was wanted.
"""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.cholesky import all_finite
from slip_core.compiled import part
from slip_core.records import WholeArray
from slip_vic_controller.arm.command import CommandLimits, SentCommand

LONGEST_STEP_S = 0.005
"""Time between two commands that the rate limit counts at most, so that a pause allows no jump [s]."""
HELD = 0.2
"""Share of the effort limit by which the measured effort may be off gravity: an object, friction, a wrong model."""


@part
def start_limiter(
    limits: CommandLimits, state: SentCommand, n: int, measured: Array, gravity: Array, now_ns: int
) -> None:
    """Set what the first command, or the first after a pause, is limited from; (n,) [N m].

    The measured effort is what the joints feel now, so a restart makes no torque step; no farther from gravity
    compensation than HELD, as drivers publish currents, too. Where there is none (not finite, or all zero, which a
    driver without torque sensors publishes) it is gravity compensation. The first step counts one control period.
    """
    known = bool(all_finite(measured[:n]) and measured[:n].any())
    for j in range(n):
        limit, start = limits.effort[j], gravity[j]
        if known:
            start = min(max(measured[j], start - HELD * limit), start + HELD * limit)
        state.effort[j] = min(max(start, -limit), limit)
    state.started, state.now_ns = 1, now_ns - limits.period_ns


@part
def needs_restart(limits: CommandLimits, state: SentCommand, now_ns: int) -> bool:
    """Return whether the last command is so old that the joints may feel something else by now."""
    return bool(state.started == 0 or now_ns - state.now_ns > limits.restart_after_ns)


@part
def limit_effort(
    limits: CommandLimits, state: SentCommand, n: int, wanted: Array, now_ns: int, clipped: WholeArray,
    limited: WholeArray,
) -> bool:  # fmt: skip
    """Let an effort out: finite, clipped, slope-limited, in this order; the result is `state.effort`.

    Args:
        limits, state: of the limiter; state is changed.
        n: number of joints.
        wanted: (n,) [N m].
        now_ns: the controller's clock.
        clipped, limited: result; which joints were clipped or limited, and which were limited in rate; (n,) 0 or 1.

    Returns:
        Whether `wanted` was finite; if not, the last effort goes out again.
    """
    finite = all_finite(wanted[:n])
    # The same slope at every control rate; a clock that goes back allows no step.
    step = limits.effort_rate * 1e-9 * min(max(now_ns - state.now_ns, 0), limits.longest_step_ns)
    for j in range(n):
        limit, before = limits.effort[j], state.effort[j]
        torque = wanted[j] if finite else before
        inside = min(max(torque, -limit), limit)
        effort = min(max(inside, before - step), before + step)
        # Where the rate does not bind this is `inside` to the last bit. Rounding may not carry it over the limit.
        effort = min(max(effort, -limit), limit)
        limited[j] = 1 if effort != inside else 0
        clipped[j] = 1 if effort != inside or inside != torque else 0
        state.effort[j] = effort
    state.now_ns = max(now_ns, state.now_ns)
    return finite
