"""When the compensation is given up: where it does not end the slip, or takes the arm away, the impedance works alone.

The law promises that slip decays at the rate k_s once the slip activation is open. Where it stays open for long, or
the arm has given way far, that promise is broken: the model is wrong, the slip is not there, or friction cannot carry
the object. An open activation is then worse than none: it hands the arm's own acceleration back to it, and the arm
drifts. Given up, the slip activation and the fading are off, as in classical impedance control, until slip has been
insignificant for a while.

Below a governor nothing should slip: there the model alone is no proof, for it may be the model that is wrong, and the
compensation is at work only while the slip sensor's own samples tell of slip.
"""

from __future__ import annotations

from typing import Final

from slip_core.compiled import part
from slip_core.records import Real, Record, Whole, dtype_of
from slip_core.vectors import Spatial
from slip_vic_controller.law.gains import Gains
from slip_vic_controller.law.impedance import slip_activation, slip_speed

OPEN: Final = 0.1
"""Slip activation from which the compensation counts as at work."""


class GivingUpConfig(Record):
    """When the compensation is given up."""

    on: Whole  # 0 = never, as printed
    witness: Whole  # 1 = the compensation needs evidence from the slip sensor itself
    longest_s: Real  # s; that it may be at work
    calm_s: Real  # s; that slip must be over after it has been given up
    error: Real  # m; by which the arm may give way in that time
    fall: Real  # m/s; speed down at which it may
    speed: Real  # m/s; of a slip that it does not end any more
    fast_s: Real  # s; that it must be as fast


GIVING_UP = dtype_of(GivingUpConfig)


class CompensationState(Record):
    """Whether the compensation is at work, and for how long."""

    given_up: Whole  # 1 while the impedance works alone
    times: Whole  # how often
    open_s: Real  # s; how long the slip activation has been open, less how long it has been shut since
    error: Real  # m; when it opened
    fast_s: Real  # s; for how long the slip has been faster than it may be


GIVEN_UP = dtype_of(CompensationState)


@part
def start_giving_up(state: CompensationState) -> None:
    """Begin: the compensation is at work."""
    state.given_up, state.times, state.open_s, state.error, state.fast_s = 0, 0, 0.0, 0.0, 0.0


@part
def judge_compensation(
    config: GivingUpConfig, state: CompensationState, gains: Gains, v_s: Spatial, seen: int, error: float,
    fall: float, dt: float,
) -> None:  # fmt: skip
    """Give the compensation up, or take it up again, and switch it off in the gains where it is given up.

    Args:
        config: when it is given up.
        state: changed.
        gains: of this cycle; changed.
        v_s: slip velocity that the law shall use [m/s, rad/s].
        seen: whether the slip sensor's own samples tell of slip, 0 or 1.
        error: distance of the pad from its reference [m].
        fall: how much faster than the reference the object moves down, while it slips [m/s].
        dt: since the cycle before [s].

    Implements: ours.
    """
    if config.on == 0:
        return
    wanted = config.witness == 0 or seen != 0
    if wanted and slip_activation(gains, v_s) > OPEN:
        state.open_s = min(state.open_s + dt, config.longest_s if state.given_up == 0 else config.calm_s)
    else:
        state.open_s = max(state.open_s - dt, 0.0)
    state.fast_s = state.fast_s + dt if wanted and slip_speed(gains, v_s) > config.speed else 0.0
    if state.open_s == 0.0:
        state.given_up, state.error = 0, error
    elif state.given_up == 0 and (
        state.open_s >= config.longest_s
        or error > state.error + config.error
        or fall > config.fall
        or state.fast_s > config.fast_s
    ):
        state.given_up, state.open_s = 1, config.calm_s
        state.times += 1
    if state.given_up != 0 or not wanted:
        gains.alpha = 0.0
        gains.gamma_k[:] = 0.0
        gains.gamma_d[:] = 0.0
