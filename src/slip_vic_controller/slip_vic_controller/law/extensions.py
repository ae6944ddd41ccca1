"""Extensions of the printed law, each with its reason; with printed settings none has an effect.

`authority`, `fade_with_gate` and `judge_compensation` are one mechanism, bounded authority: where joint state or slip
are estimates, noise and delay can keep the gate open without slip, and an open gate feeds the arm's own acceleration
back. So the compensation replaces the impedance instead of adding to it, fades with the distance from the reference,
and is switched off if slip does not end.
"""

from __future__ import annotations

import math
from typing import Final

from slip_core.compiled import part
from slip_core.records import Real, Record
from slip_core.vectors import Mat, Spatial
from slip_vic_controller.law.gains import Gains
from slip_vic_controller.law.paper import slip_activation


@part
def slip_speed(gains: Gains, v_s: Spatial) -> float:
    """Return the norm of a slip velocity [m/s], angular part times the characteristic length l (printed law: 1 m).

    Reason: metres and radians per second are not comparable; a pad that turns by a few mrad/s opens the printed gate.

    Implements: ours: |v_s|^2 = |v_sl|^2 + l^2 |v_sa|^2.
    """
    length = gains.characteristic_length
    linear, angular = v_s.linear, v_s.angular
    return math.sqrt(linear.dot(linear) + length * length * angular.dot(angular))


@part
def limit_spin(limit: float, motion: Spatial) -> Spatial:
    """Return an acceleration with its angular part shortened to `limit` [rad/s^2].

    Reason: the printed law follows the object's spin without bound. With an angular stiffness that does not fade, K_o
    e_o = M_o limit bounds the attitude error.

    Implements: ours: |angular part| <= limit.
    """
    size = motion.angular.norm()
    if size > limit:
        return Spatial(motion.linear, (limit / size) * motion.angular)
    return motion


@part
def authority(yields: float, error: float) -> float:
    """Return the fraction of the compensation that remains at a distance `error` [m] from the reference; 0 at `yields`.

    Reason: far from the reference, arm and object would keep drifting together, whether the slip is real or noise.

    Implements: ours: 1 - (error / yields)^2.
    """
    share = error / yields
    return max(1.0 - share * share, 0.0)


@part
def fade_with_gate(R_ee: Mat, slip_axes: Spatial, gate: float, motion: Spatial) -> Spatial:
    """Return the part of a_d + Z {w} that an open gate removes on the slip axes of the pad [m/s^2, rad/s^2].

    Reason: with the gate open a slip of this acceleration over k_s remains, and delays bound k_s. Theta fades so in the
    printed law.

    Implements: ours: gate S (a_d + Z).
    """
    return gate * (R_ee @ (slip_axes * (R_ee.T() @ motion)))


OPEN: Final = 0.1
"""Slip activation from which the compensation counts as active."""
FALLS_M_S: Final = 0.01
"""Falling speed of the object from which the compensation is given up [m/s]: with inexactly known drives a faster fall
cannot be caught."""
FASTEST_M_S: Final = 0.08
"""Slip that the compensation does not end [m/s]: if it is as fast for FAST_S, arm and object oscillate against each
other. An estimate that starts from a wrong model is as fast for some cycles."""
FAST_S: Final = 0.01
CALM_S: Final = 0.15
"""How long the gate must have been closed before the compensation is resumed [s]."""


class CompensationState(Record):
    """Whether the compensation is given up."""

    left_s: Real  # s; for which the gate must still be shut until it is resumed, 0 = it is active
    fast_s: Real  # s; for how long the slip has been faster than it may be


@part
def judge_compensation(state: CompensationState, gains: Gains, v_s: Spatial, fall: float, dt: float) -> None:
    """Give up or resume the compensation; while it is given up, it is off in the gains.

    Reason: with an open gate slip should decay at the rate k_s. If the object falls or slips fast nevertheless, the
    model is wrong, there is no slip, or friction cannot carry the object. Then only the impedance is active until slip
    has been insignificant for a while.

    Args:
        state: changed.
        gains: of this cycle; changed.
        v_s: slip velocity that the law is to use [m/s, rad/s].
        fall: how much faster than the reference the object moves down, while it slips [m/s].
        dt: since the cycle before [s].

    Implements: ours.
    """
    speed = slip_speed(gains, v_s)
    state.fast_s = state.fast_s + dt if speed > FASTEST_M_S else 0.0
    if slip_activation(gains.alpha, speed) <= OPEN:
        state.left_s = max(state.left_s - dt, 0.0)
    elif fall > FALLS_M_S or state.fast_s > FAST_S:
        state.left_s = CALM_S
    if state.left_s > 0.0:
        gains.alpha = 0.0
        gains.gamma_k[:] = 0.0
        gains.gamma_d[:] = 0.0
