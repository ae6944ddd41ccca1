"""Which gains are safe: the sampled-data bound on k_s, and the conditions of Propositions 1 to 3 with their margins."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Literal, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import INT, REAL, kernel
from slip_core.errors import InputError
from slip_core.types import AXES

Mode = Literal["auto", "fixed"]


class Condition(NamedTuple):
    """One condition: its name, the value, the limit it is compared with, and the reason.

    margin: how many times better than needed; below 1 the condition does not hold.
    parameter: what to change then; upper: whether the limit is the largest value that holds.
    """

    name: str
    value: float
    limit: float
    margin: float
    reason: str
    parameter: str
    upper: bool = True

    @property
    def holds(self) -> bool:
        """Whether the condition is met."""
        return self.margin >= 1.0


class GainReport(NamedTuple):
    """Verdict on the gains: k_s as requested, as used and largest accepted [1/s]; lambdas; conditions.

    lambda_1, lambda_2: intervals (open at both ends) from which Propositions 1 and 2 may choose; empty where low >= 1.
    """

    asked: float
    used: float
    accepted: float
    lambda_1: tuple[float, float]
    lambda_2: tuple[float, float]
    conditions: tuple[Condition, ...]

    @property
    def hold(self) -> bool:
        """Whether every condition is met."""
        return all(condition.holds for condition in self.conditions)


@kernel(REAL(INT, INT))
def held_sample_limit(held: int, delay: int) -> float:
    """Return the largest stable k_s T for a sample every `held` ticks that is `delay` ticks old when it arrives.

    From sample j to j + 1 the velocity loses k_s T times: the older sample for the first r ticks, then the newer one
    for N - r, with delay = q N + r. So all roots of z^(q+1) (z - 1) + k_s T ((N - r) z + r) must lie inside |z| = 1.
    The first root leaves the circle at the smallest angle theta at which both terms are opposite,

        (q + 3/2) theta - arg((N - r) z + r) = pi / 2,   z = exp(i theta),

    and there k_s T = |z - 1| / |(N - r) z + r|, which grows with theta. The left side is below pi / 2 before that angle
    and not after it, so it is found by bisection: the same work for every delay.

    Exact for whole ticks and a zero-order hold; 2 cos(q pi / (2 q + 1)) / N where r = 0.
    """
    q = delay // held
    r = delay - q * held
    if r == 0:
        return 2.0 * math.cos(q * math.pi / (2 * q + 1)) / held
    newer, older = float(held - r), float(r)
    low, high = 0.0, math.pi
    for _ in range(60):
        theta = 0.5 * (low + high)
        phase = (q + 1.5) * theta - math.atan2(newer * math.sin(theta), newer * math.cos(theta) + older)
        if phase < 0.5 * math.pi:
            low = theta
        else:
            high = theta
    c, s = math.cos(0.5 * low), math.sin(0.5 * low)
    return 2.0 * s / math.sqrt((newer - older) * (newer - older) + 4.0 * newer * older * c * c)


INTERNAL_BOUND = 0.38
"""Of kappa k tau^2 / M_D."""
DRIVE_SHARE = 0.25
"""Of that bound, on an arm with estimated joints: with the lag of its drives in tau two pads swing from 0.65 on."""


@kernel(REAL(REAL, REAL, REAL))
def internal_gain_limit(inertia: float, stiffness: float, delay_s: float) -> float:
    """Return the largest kappa with which giving way to the internal wrench does not swing, with a margin.

    An elastic pad pushed by its own force, late: kappa k tau^2 / M_D below 0.38; from 0.5 on our studies lose objects.

    Args:
        inertia: least M_D [kg].
        stiffness: of the pad [N/m].
        delay_s: from a wrench to the motion that it causes [s].
    """
    return INTERNAL_BOUND * inertia / (stiffness * delay_s * delay_s)


def delay_margin(stiffness: float, damping: float, inertia: float) -> float:
    """Return the delay [s] at which M s^2 + (D s + K) e^(-s T) loses its stability: phase margin over crossover.

    |K + j w D| = M w^2 gives the crossover w, and the phase margin there is atan(w D / K).
    """
    ratio, rate = stiffness / inertia, damping / inertia
    w = math.sqrt(0.5 * (rate * rate + math.hypot(rate * rate, 2.0 * ratio)))
    return math.atan2(w * rate, ratio) / w


def stiffness_limit(damping: float, inertia: float, delay_s: float) -> float:
    """Return the K [N/m, N m/rad] whose `delay_margin` is a delay [s]; 0 where the damping alone swings.

    More stiffness moves the crossover up and takes phase away: the margin falls with K, and K < D / T, where no phase
    is left at small crossovers, bounds it from above.
    """
    low, high = 0.0, damping / delay_s
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if delay_margin(middle, damping, inertia) > delay_s else (low, middle)
    return low


def judge_stiffness(stiffness: Array, damping: Array, inertia: Array, delay_s: float) -> tuple[Condition, ...]:
    """Judge the stiffness of each axis by what a delay admits; diagonals (6,) [N/m, N m/rad, ...], delay [s]."""
    found = []
    for axis, K, D, M in zip(AXES, stiffness, damping, inertia, strict=True):
        limit = stiffness_limit(D, M, delay_s)
        reason = (
            f"with {1e3 * delay_s:.3g} ms from a measurement to the motion that it causes the impedance swings from "
            f"there on about axis {axis}; more damping admits more"
        )
        found.append(Condition(f"K_D {axis}", K, limit, limit / K, reason, "gains.stiffness"))
    return tuple(found)


def slip_gain_limit(control_period_s: float, sensor_period_s: float = 0.0, latency_s: float = 0.0) -> float:
    """Return the k_s [1/s] at which the sampled slip loop v' = -k_s v(last sample) stops decaying.

    A sample measured every N ticks and published d ticks later is held until the next one; a measurement of this tick
    acts in this tick (d = 0). All times [s], rounded up to whole ticks, which is the worst case. For N = 1 it is
    k_s T < 2 cos(d pi / (2 d + 1)); see `held_sample_limit` for slower sensors.
    """
    held = _ticks(max(sensor_period_s, control_period_s), control_period_s)
    return held_sample_limit(held, _ticks(latency_s, control_period_s)) / control_period_s


def _ticks(time_s: float, period_s: float) -> int:
    return math.ceil(time_s / period_s - 1e-6)


def judge_gains(
    damping: Array,
    k_s: float,
    mode: Mode,
    *,
    gain_margin: float,
    control_period_s: float,
    sensor_period_s: float,
    latency_s: float,
    refuse: bool = False,
) -> GainReport:
    """Judge the gains, and clamp k_s where `mode` is auto.

    Args:
        damping: diagonal of D_D; (6,) [N s/m, N m s/rad].
        k_s: requested [1/s].
        mode: auto uses the smaller of `k_s` and what is accepted; with fixed a larger one does not hold.
        gain_margin: how far below the stability limit k_s must stay.
        control_period_s, sensor_period_s, latency_s: of the slip loop [s]; with an observer the sensor's are 0.
        refuse: whether a condition that does not hold is an error.

    Raises:
        InputError: where `refuse`, a fixed k_s beyond the bound, or no lambda for a proposition.
    """
    limit = slip_gain_limit(control_period_s, sensor_period_s, latency_s)
    accepted = limit / gain_margin
    # Rounding must not refuse the number that an earlier refusal has named.
    used = min(k_s, accepted) if mode == "auto" else k_s
    least = float(np.min(damping))
    lambda_1, lambda_2 = (1.0 / least, 1.0), (1.0 / used, 1.0)
    product = lambda_1[0] * lambda_2[0]
    conditions = (
        Condition(
            "k_s sampled", used, accepted, accepted * (1.0 + ROUNDING) / used,
            f"stable below {limit:.6g} 1/s with a control period of {1e3 * control_period_s:g} ms, a slip sample every "
            f"{1e3 * max(sensor_period_s, control_period_s):g} ms and {1e3 * latency_s:g} ms late, drives included; "
            f"a gain margin of {gain_margin:g} is kept", "gains.k_s",
        ),
        Condition(
            "D_D (Prop. 1)", least, 1.0, least, "Prop. 1: lambda_min(D_D) > 1/lambda_1 needs a lambda_1 below 1",
            "gains.damping", upper=False,
        ),
        Condition(
            "k_s (Prop. 2)", used, 1.0, used, "Prop. 2: k_s > 1/lambda_2 needs a lambda_2 below 1",
            "gains.k_s", upper=False,
        ),
        Condition(
            "small gain (Prop. 3)", product, 1.0, 1.0 / product,
            "Prop. 3: lambda_1 lambda_2 < 1, with the smallest that Prop. 1 and 2 allow", "gains.damping",
        ),
    )  # fmt: skip
    report = GainReport(k_s, used, accepted, lambda_1, lambda_2, conditions)
    if refuse:
        check(report.conditions)
    return report


def check(conditions: Iterable[Condition]) -> None:
    """Raise the first condition that does not hold as an InputError, with the parameter that it is about."""
    for condition in conditions:
        if not condition.holds:
            raise InputError(
                f"parameter {condition.parameter}",
                got=f"{condition.value:g}",
                expected=f"{'at most' if condition.upper else 'more than'} {condition.limit:.6g}",
                fix=condition.reason,
            )


ROUNDING = 1e-5
"""A k_s typed with the six digits of the message that refused the last one is accepted."""
