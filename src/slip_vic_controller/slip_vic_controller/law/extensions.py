"""What we add to the printed law, each with its reason; with printed settings each of them changes nothing.

`authority`, `fade_with_gate` and `judge_compensation` are one mechanism, bounded authority: where joint state or slip
are estimates, noise and delay can hold the gate open although nothing slips, and an open gate hands the arm's own
acceleration back to it. So the compensation takes over from the impedance instead of adding to it, fades with the
distance from the reference, and is switched off where slip does not end.
"""

from __future__ import annotations

import math
from typing import Final

from slip_core.compiled import part
from slip_core.records import Real, Record, Whole, dtype_of
from slip_core.vectors import ZERO, Mat, Spatial
from slip_vic_controller.law.gains import Gains
from slip_vic_controller.law.paper import slip_activation


@part
def slip_speed(gains: Gains, v_s: Spatial) -> float:
    """Return the size of a slip velocity [m/s], turning by its characteristic length l, which is 1 m as printed.

    Reason: metres and radians per second are not comparable; a pad that turns by a few mrad/s opens the printed gate.

    Implements: ours: |v_s|^2 = |v_sl|^2 + l^2 |v_sa|^2.
    """
    length = gains.characteristic_length
    linear, angular = v_s.linear, v_s.angular
    return math.sqrt(linear.dot(linear) + length * length * angular.dot(angular))


@part
def limit_spin(limit: float, motion: Spatial) -> Spatial:
    """Return an acceleration with its angular part shortened to `limit` [rad/s^2].

    Reason: the printed law follows the object's spin wherever it goes. With an angular stiffness that does not fade,
    K_o e_o = M_o limit bounds how far the attitude gives way.

    Implements: ours: |angular part| <= limit.
    """
    size = motion.angular.norm()
    if size > limit:
        return Spatial(motion.linear, (limit / size) * motion.angular)
    return motion


@part
def beyond_dead_band(v_s: Spatial, linear: float, angular: float) -> Spatial:
    """Return a slip velocity [m/s, rad/s] with zero for what lies in the dead band; without a band itself.

    Reason: noise of a sensor that is used as it comes would hold the gate open.

    Implements: ours.
    """
    return Spatial(
        v_s.linear if linear == 0.0 or v_s.linear.norm() > linear else ZERO,
        v_s.angular if angular == 0.0 or v_s.angular.norm() > angular else ZERO,
    )


@part
def authority(yields: float, error: float) -> float:
    """Return the share of the compensation that is left where the pad is `error` off its reference [m]; 0 at `yields`.

    Reason: far off the reference arm and object would drift on together, whether the slip is real or noise.

    Implements: ours: 1 - (error / yields)^2.
    """
    share = error / yields
    return max(1.0 - share * share, 0.0)


@part
def fade_with_gate(R_ee: Mat, slip_axes: Spatial, gate: float, motion: Spatial) -> Spatial:
    """Return the part of a_d + Z {w} that an open gate takes away on the slip axes of the pad [m/s^2, rad/s^2].

    Reason: with the gate open a slip of this acceleration over k_s remains, and delays bound k_s. Theta fades so in the
    printed law.

    Implements: ours: gate S (a_d + Z).
    """
    return gate * (R_ee @ (slip_axes * (R_ee.T() @ motion)))


OPEN: Final = 0.1
"""Slip activation from which the compensation counts as active."""


class GivingUpConfig(Record):
    """When the compensation is given up."""

    on: Whole  # 0 = never, as printed
    witness: Whole  # 1 = the compensation needs evidence from the slip sensor itself
    longest_s: Real  # s; that it may be active
    calm_s: Real  # s; that slip must be over after it has been given up
    error: Real  # m; by which the arm may give way in that time
    fall: Real  # m/s; downward speed at which it may
    speed: Real  # m/s; of a slip that it does not end any more
    fast_s: Real  # s; that it must be as fast


GIVING_UP = dtype_of(GivingUpConfig)


class CompensationState(Record):
    """Whether the compensation is active, and for how long."""

    given_up: Whole  # 1 while the impedance works alone
    times: Whole  # how often
    open_s: Real  # s; how long the slip activation has been open, less how long it has been shut since
    error: Real  # m; when it opened
    fast_s: Real  # s; for how long the slip has been faster than it may be


GIVEN_UP = dtype_of(CompensationState)


@part
def start_giving_up(state: CompensationState) -> None:
    """Start with the compensation active."""
    state.given_up, state.times, state.open_s, state.error, state.fast_s = 0, 0, 0.0, 0.0, 0.0


@part
def judge_compensation(
    config: GivingUpConfig, state: CompensationState, gains: Gains, v_s: Spatial, seen: int, error: float,
    fall: float, dt: float,
) -> None:  # fmt: skip
    """Give the compensation up or resume it, and switch it off in the gains while it is given up.

    Reason: the law promises that slip decays at the rate k_s once the gate is open. Where the gate stays open, the arm
    gives way far, or the object falls, the model is wrong, there is no slip, or friction cannot carry the object. Then
    the impedance works alone until slip has been insignificant for a while. Below a governor nothing should slip: the
    model alone proves nothing there, and the compensation is active only while the slip sensor itself shows slip.

    Args:
        config: when it is given up.
        state: changed.
        gains: of this cycle; changed.
        v_s: slip velocity that the law is to use [m/s, rad/s].
        seen: whether the slip sensor's own samples show slip, 0 or 1.
        error: distance of the pad from its reference [m].
        fall: how much faster than the reference the object moves down, while it slips [m/s].
        dt: since the cycle before [s].

    Implements: ours.
    """
    if config.on == 0:
        return
    wanted = config.witness == 0 or seen != 0
    speed = slip_speed(gains, v_s)
    if wanted and slip_activation(gains.alpha, speed) > OPEN:
        state.open_s = min(state.open_s + dt, config.longest_s if state.given_up == 0 else config.calm_s)
    else:
        state.open_s = max(state.open_s - dt, 0.0)
    state.fast_s = state.fast_s + dt if wanted and speed > config.speed else 0.0
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
