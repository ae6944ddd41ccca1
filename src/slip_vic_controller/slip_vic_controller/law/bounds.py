"""Which gains are safe: bounds by delays, and the conditions of Propositions 1 to 3 with their margins."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import INT, REAL, kernel, part
from slip_core.errors import InputError
from slip_core.types import AXES
from slip_vic_controller.sizes import BISECTIONS


class Condition(NamedTuple):
    """One condition: name, value, limit, reason, and the parameter to change.

    upper: whether the limit is the largest value that holds, else the smallest.
    """

    name: str
    value: float
    limit: float
    reason: str
    parameter: str
    upper: bool = True

    @property
    def margin(self) -> float:
        """Margin of the value to its limit, as a factor; below 1 the condition does not hold."""
        return self.limit / self.value if self.upper else self.value / self.limit

    @property
    def holds(self) -> bool:
        """Whether the condition is met."""
        return self.margin >= 1.0

    @property
    def line(self) -> str:
        """What is compared, whether it holds, and why it has to."""
        numbers = f"{self.value:.6g}, limit {self.limit:.6g}, margin {self.margin:.3g}"
        return f"{self.name} {'holds' if self.holds else 'fails'}: {numbers}; {self.reason}"


class GainReport(NamedTuple):
    """Verdict on the gains: k_s as requested, as used and largest accepted [1/s]; conditions; LAW_GAINS that result."""

    asked: float
    used: float
    accepted: float
    conditions: tuple[Condition, ...]
    gains: Array

    @property
    def hold(self) -> bool:
        """Whether every condition is met."""
        return all(condition.holds for condition in self.conditions)


@kernel(REAL, INT, INT)
def held_sample_limit(held: int, delay: int) -> float:
    """Return the largest stable k_s T for a sample every `held` ticks that is `delay` ticks old when it arrives.

    From sample j to j + 1 the velocity changes by -k_s T times the older sample for the first r ticks, then the newer
    one for N - r, with delay = q N + r. So all roots of z^(q+1) (z - 1) + k_s T ((N - r) z + r) must lie inside the
    unit circle. The first root leaves it at the smallest angle theta at which both terms are opposite,

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
    for _ in range(BISECTIONS):
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
"""Of that bound, with estimated joints: with the lag of the drives in tau, two pads oscillate from 0.65 on."""


@kernel(REAL, REAL, REAL, REAL)
def internal_gain_limit(inertia: float, stiffness: float, delay_s: float) -> float:
    """Return the largest kappa with which yielding to the internal wrench does not oscillate, with a margin.

    An elastic pad pushed by its own force, late: kappa k tau^2 / M_D below 0.38; from 0.5 on our studies lose objects.

    Args:
        inertia: least M_D [kg].
        stiffness: of the pad [N/m].
        delay_s: from a wrench to the motion that it causes [s].
    """
    return INTERNAL_BOUND * inertia / (stiffness * delay_s * delay_s)


@part
def delay_margin(stiffness: float, damping: float, inertia: float) -> float:
    """Return the delay [s] at which M s^2 + (D s + K) e^(-s T) loses its stability: phase margin over crossover.

    |K + j w D| = M w^2 gives the crossover w, and the phase margin there is atan(w D / K).
    """
    ratio, rate = stiffness / inertia, damping / inertia
    w = math.sqrt(0.5 * (rate * rate + math.hypot(rate * rate, 2.0 * ratio)))
    return math.atan2(w * rate, ratio) / w


@kernel(REAL, REAL, REAL, REAL)
def stiffness_limit(damping: float, inertia: float, delay_s: float) -> float:
    """Return the K [N/m, N m/rad] whose `delay_margin` is a delay [s]; 0 where the damping alone is unstable.

    More stiffness raises the crossover and reduces the phase: the margin falls with K, and K < D / T, where no phase is
    left at small crossovers, bounds it from above.
    """
    low, high = 0.0, damping / delay_s
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if delay_margin(middle, damping, inertia) > delay_s else (low, middle)
    return low


def judge_stiffness(stiffness: Array, damping: Array, inertia: Array, delay_s: float) -> tuple[Condition, ...]:
    """Compare the stiffness of each axis with the limit that a delay sets; diagonals (6,) [N/m, N m/rad, ...], delay
    [s]."""
    found = []
    for axis, K, D, M in zip(AXES, stiffness, damping, inertia, strict=True):
        limit = stiffness_limit(D, M, delay_s)
        reason = (
            f"with {1e3 * delay_s:.3g} ms from a measurement to the motion that it causes, the impedance oscillates "
            f"above this stiffness on axis {axis}; more damping admits more"
        )
        found.append(Condition(f"K_D {axis}", K, limit, reason, "gains.stiffness"))
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


def judge_gains(damping: Array, k_s: float) -> tuple[Condition, ...]:
    """Judge damping (6,) [N s/m, N m s/rad] and k_s [1/s] by the propositions of the paper.

    Proposition k needs a lambda_k with 1/value < lambda_k < 1, and Proposition 3 lambda_1 lambda_2 < 1: all exist if
    both values are above 1.
    """
    reason = "Prop. {0}: {1} > 1/lambda_{0} needs a lambda_{0} below 1"
    return (
        Condition(
            "D_D (Prop. 1)", float(np.min(damping)), 1.0, reason.format(1, "lambda_min(D_D)"), "gains.damping",
            upper=False,
        ),
        Condition("k_s (Prop. 2)", k_s, 1.0, reason.format(2, "k_s"), "gains.k_s", upper=False),
    )  # fmt: skip


def check(conditions: Iterable[Condition]) -> None:
    """Raise an InputError for the first condition that does not hold, with its parameter."""
    for condition in conditions:
        if not condition.holds:
            raise InputError(
                f"parameter {condition.parameter}",
                got=f"{condition.value:g}",
                expected=f"{'at most' if condition.upper else 'more than'} {condition.limit:.6g}",
                fix=condition.reason,
            )
