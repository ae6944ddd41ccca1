"""The belief about friction: the probability of each friction limit, with the object sticking and sliding.

Hypothesis i: friction carries r_i F, F the limit configured at this grip. A hidden Markov model of two modes
for each: a_i = P(r_i, sticks), b_i = P(r_i, slides). A cycle compares the load l of the wrench with the load p that the
motion needs, each sample of the slip sensor counts at its own stamp, and the risk quantile of what the contact still
carries, a_i at r_i and b_i at k r_i, sets the squeeze.

    p = mean l + d - mean d,   d: load of the commanded acceleration

p follows the wrench only while the object sticks: in a slip the measured load falls with friction, and a squeeze that
followed it would lose the object. The means absorb a wrong mass and a wrong centre of mass.

Noise must not look like a load that friction carries, for the evidence of many cycles adds up: the size of the noise is
taken off l, what sticks carries p corrected by l only as far as p is in doubt, and slip is expected only where the load
exceeds F_i beyond doubt. Without evidence the belief returns to the prior.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Vec6, Whole, WholeArray
from slip_core.vectors import ZERO, Spatial, Vec, put_spatial, spatial

RATIOS: Final = 48
"""Hypotheses, evenly on a logarithmic scale."""
PAST: Final = 80
"""Number of past times whose slide probabilities are stored, for samples that arrive late."""


class Tuning(NamedTuple):
    """What the belief assumes. Shares are of a load, of friction or of a probability."""

    least_ratio: float = 0.25  # r of the first hypothesis
    step: float = 0.049  # of log r, to 2.5
    slides_cells: int = 2  # k = exp(-2 step) = 0.907, friction of what slides over friction of what sticks
    spread: float = 0.25  # standard deviation of log r at first
    diffusion: float = 0.05  # of log r, after one second: friction changes
    change_rate: float = 1e-2  # 1/s, of a sudden change: any friction by the prior
    mean_s: float = 0.04  # T, of the means of loads
    wrench_s: float = 0.01  # mean of the wrench, before its size is taken; it counts once in this time
    least_likelihood: float = 0.02  # one reading never excludes a mode
    slides: float = 0.5  # P(slides) from which the object slides for all others
    model_error: float = 0.3  # of a change of the load
    load_error: float = 0.05  # of the load, biases of the wrench included
    sliding_error: float = 0.07  # of friction while it slides
    transition: float = 0.04  # of friction, over which a slip becomes likely
    onset_s: float = 0.005  # of a slip where the load is too large
    onset_rate: float = 1e-3  # 1/s, where nothing says so
    ends_s: float = 0.02  # of a slip where the load is small
    fast: float = 0.02  # m/s, typical slip speed: a band that is wider says little
    least_band: float = 0.05  # likelihood of reading no slip while it slides
    most_band: float = 0.5
    outlier: float = 0.03  # likelihood of reading a slip where there is none
    counts: float = 2.0  # standard deviations by which a load must exceed another one to count
    stands: float = 0.9  # share of the commanded load that counts whatever the wrench measures
    past_s: float = 0.004  # between two times that are kept
    noise_s: float = 0.1  # in which the noise of the load is found
    axes: float = 2.0  # along which the wrench is noisy
    of_change: float = 0.5 / math.sqrt(math.log(2.0))  # of one axis: standard deviation over the median of changes
    least_noise: float = 5e-3  # of friction
    first_noise: float = 0.03  # of friction


BELIEF_TUNING: Final = Tuning()
RATIO: Final = np.array([BELIEF_TUNING.least_ratio * math.exp(i * BELIEF_TUNING.step) for i in range(RATIOS)])
"""r_i."""
PRIOR: Final = np.array([math.exp(-0.5 * (math.log(r) / BELIEF_TUNING.spread) ** 2) for r in RATIO.tolist()])
"""Probability of each hypothesis at first, over `PRIORS`."""
PRIORS: Final = float(np.cumsum(PRIOR)[-1])  # `sum` rounds differently from Python 3.12 on
RISE: Final = np.sqrt(PRIOR[1:] / PRIOR[:-1])
"""Diffusion to the next hypothesis, over the one without a prior; back: the inverse. The prior is stationary then."""
_SQRT_HALF: Final = math.sqrt(0.5)


class Belief(Record):
    """P(r_i, sticks) and P(r_i, slides), and the memory of loads."""

    sticks: Annotated[Array, RATIOS]
    slides: Annotated[Array, RATIOS]
    measured: Real  # N, mean l
    commanded: Real  # N, mean d
    load: Vec6  # N, mean of the load of the wrench over wrench_s, on pad axes
    carried: Real  # N, l, its size
    drawn: Real  # N, mean of d over wrench_s
    last: Vec6  # N, load of the cycle before
    noise: Real  # N, standard deviation of the mean load along an axis
    needed: Real  # N, p
    count: Whole  # times that are kept
    stamps: Annotated[WholeArray, PAST]  # of them
    past: Annotated[Array, (PAST, RATIOS)]  # P(slides | r_i) then


@part
def below(x: float) -> float:
    """Return the standard normal distribution function."""
    return 0.5 * (1.0 + math.erf(x * _SQRT_HALF))


@part
def start_belief(state: Belief, load: float, F: float) -> None:
    """Begin at rest with a load [N]; F: friction as configured at this grip [N]."""
    state.sticks[:], state.slides[:] = PRIOR / PRIORS, 0.0
    state.measured = state.commanded = state.drawn = state.carried = state.needed = load
    put_spatial(state.load, Spatial(Vec(load, 0.0, 0.0), ZERO))
    state.last[:] = state.load
    state.noise, state.count = BELIEF_TUNING.first_noise * F, 0


@part
def sliding(state: Belief) -> float:
    """Return P(slides)."""
    total = 0.0
    for i in range(RATIOS):
        total += state.slides[i]
    return total


@part
def model_load(state: Belief, load: Spatial, d: float, F: float, dt: float) -> tuple[float, float]:
    """Update with the loads of a cycle; return p without the newest changes, and the deviation of d from its mean [N].

    Args:
        state: changed.
        load: of the wrench, on pad axes [N].
        d: load of the commanded acceleration [N].
        F: friction as configured at the present grip [N].
        dt: since the cycle before [s].
    """
    t, stuck = BELIEF_TUNING, 1.0 - sliding(state)
    stuck = stuck if stuck >= 1.0 - t.slides else 0.0
    share, change = 1.0 - math.exp(-dt / t.wrench_s), load - spatial(state.last)
    step = math.sqrt(0.5 * share * change.dot(change))
    if stuck > 0.0 and step > 0.0:  # a wrench that is repeated has no noise
        grows = step * t.of_change > state.noise
        state.noise = max(state.noise * (1.0 + (dt if grows else -dt) / t.noise_s), t.least_noise * F)
    put_spatial(state.last, load)
    mean = spatial(state.load)
    mean = mean + share * (load - mean)
    put_spatial(state.load, mean)
    state.carried = math.sqrt(max(mean.dot(mean) - t.axes * state.noise * state.noise, 0.0))  # noise has a size too
    state.drawn += share * (d - state.drawn)
    x = state.drawn - state.commanded
    share = stuck * (1.0 - math.exp(-dt / t.mean_s))
    state.measured += share * (state.carried - state.measured)
    state.commanded += share * (state.drawn - state.commanded)
    state.needed = state.measured + d - state.commanded
    return state.measured + state.drawn - state.commanded, x


@part
def see_load(state: Belief, load: Spatial, d: float, F: float, dt: float) -> None:
    """Update with the loads of a cycle; arguments as in `model_load`.

    Implements: ours: the forward step of the hidden Markov model, then the likelihoods of l to the power dt / wrench_s.
    """
    t, k, floor = (
        BELIEF_TUNING,
        math.exp(-BELIEF_TUNING.slides_cells * BELIEF_TUNING.step),
        math.log(BELIEF_TUNING.least_likelihood),
    )
    p, change = model_load(state, load, d, F, dt)
    carried, noise = state.carried, state.noise
    power = min(dt / t.wrench_s, 1.0)
    of_model = (t.model_error * change) ** 2 + (t.load_error * carried) ** 2
    variance = noise * noise + of_model
    believed, doubt = p + (carried - p) * of_model / variance, noise * noise * of_model / variance  # of both together
    pulls = max(p, carried - t.counts * noise)
    lacks = max(p - carried, 0.0)  # a load beyond what the motion needs is carried all the same
    fits = -0.5 * lacks * lacks / variance
    for i in range(RATIOS):
        F_i = RATIO[i] * F
        x = t.transition * F_i + noise
        on = min(dt / t.onset_s * below((pulls - F_i) / x - t.counts) + t.onset_rate * dt, 1.0)
        off = min(dt / t.ends_s * below((k * F_i - p) / x + 1.0), 1.0)
        a, b = state.sticks[i], state.slides[i]
        holds = min(2.0 * below((F_i - believed) / math.sqrt(doubt + (t.load_error * F_i) ** 2)), 1.0)
        by_sticking = max(fits + math.log(max(holds, t.least_likelihood)), floor)
        gap = max(k * F_i - carried, carried - F_i, 0.0)  # what slides slowly carries nearly as much as what sticks
        by_sliding = max(-0.5 * gap * gap / (noise * noise + (t.sliding_error * F_i) ** 2), floor)
        state.sticks[i] = ((1.0 - on) * a + off * b) * math.exp(power * by_sticking)
        state.slides[i] = ((1.0 - off) * b + on * a) * math.exp(power * by_sliding)
    change_friction(state, dt)


@part
def change_friction(state: Belief, dt: float) -> None:
    """Let friction diffuse, back to the prior in the end, and occasionally jump to any value; normalise."""
    t, total = BELIEF_TUNING, 0.0
    for i in range(RATIOS):
        total += state.sticks[i] + state.slides[i]
    moves = min(0.5 * dt * (t.diffusion / t.step) ** 2, 0.25)  # to each neighbour; more in a step is not stable
    renewed = min(t.change_rate * dt, 1.0)
    a_in = b_in = 0.0  # from the neighbour before
    for i in range(RATIOS):
        a_new, b_new = state.sticks[i] + a_in, state.slides[i] + b_in
        if i + 1 < RATIOS:
            up, down = moves * RISE[i], moves / RISE[i]
            a_in = up * state.sticks[i] - down * state.sticks[i + 1]
            b_in = up * state.slides[i] - down * state.slides[i + 1]
            a_new, b_new = a_new - a_in, b_new - b_in
        state.sticks[i] = (1.0 - renewed) * a_new / total + renewed * PRIOR[i] / PRIORS
        state.slides[i] = (1.0 - renewed) * b_new / total


@part
def keep_past(state: Belief, stamp_ns: int) -> None:
    """Store the slide probability of each hypothesis if the last stored time is old enough."""
    newest = (state.count - 1) % PAST
    if state.count > 0 and stamp_ns - state.stamps[newest] < 1e9 * BELIEF_TUNING.past_s:
        return
    place = state.count % PAST
    state.stamps[place] = stamp_ns
    for i in range(RATIOS):
        state.past[place, i] = conditional(state, i)
    state.count += 1


@part
def conditional(state: Belief, i: int) -> float:
    """Return P(slides | r_i)."""
    total = state.sticks[i] + state.slides[i]
    return float(state.slides[i] / total) if total > 0.0 else 0.0


@part
def see_slip(state: Belief, stamp_ns: int, speed: float, band: float) -> None:
    """Update with a slip sample at its own stamp; its effect is propagated to the present.

    Args:
        state: changed; contains at least one past cycle.
        stamp_ns: when it was measured.
        speed: |S v_s| [m/s], of a flag infinite or 0.
        band: speed that counts as slip [m/s].
    """
    t, first = BELIEF_TUNING, state.count - 1
    while first > max(state.count - PAST, 0) and state.stamps[first % PAST] > stamp_ns:
        first -= 1
    reads = speed > band
    L_slides = 1.0 if reads else min(max(band / t.fast, t.least_band), t.most_band)
    L_sticks = t.outlier if reads else 1.0
    total = 0.0
    for i in range(RATIOS):
        q = state.past[first % PAST, i]
        weight = q * L_slides + (1.0 - q) * L_sticks
        change = q * L_slides / weight - q
        for k in range(first, state.count):
            state.past[k % PAST, i] = min(max(state.past[k % PAST, i] + change, 0.0), 1.0)
        both, now = weight * (state.sticks[i] + state.slides[i]), min(max(conditional(state, i) + change, 0.0), 1.0)
        state.slides[i], state.sticks[i] = now * both, (1.0 - now) * both
        total += both
    for i in range(RATIOS):
        state.slides[i] /= total
        state.sticks[i] /= total


@part
def certain_share(state: Belief, risk: float) -> float:
    """Return the fraction of the configured limit that friction carries except with a probability: a quantile of both
    modes."""
    lag, total = BELIEF_TUNING.slides_cells, 0.0
    for j in range(-lag, RATIOS):
        mass = (state.sticks[j] if j >= 0 else 0.0) + (state.slides[j + lag] if j + lag < RATIOS else 0.0)
        if total + mass >= risk:
            return BELIEF_TUNING.least_ratio * math.exp((j - 0.5 + (risk - total) / mass) * BELIEF_TUNING.step)
        total += mass
    return float(RATIO[RATIOS - 1])
