"""Tare at rest: what the sensors of an arm read while nothing moves, before the law begins.

Nothing slips in HOLD, and the load of the resting object is known. So the mean of a slip sensor's samples is its bias,
the mean of the wrench beyond the model's load is that of the wrench sensor, and the spread of all is their noise. A
wrench that another mass of the object explains is that of another mass, and the law works with that mass. Until the
tare has passed the wrench is the model's: a sensor that was not checked moves no joint, and a joint that moves all the
same ends the tare in FAULT.
Biases inside the configured bounds are taken out; a larger one is a reason not to begin, with the sensor's name.
Noise that is larger than configured replaces what is configured (`arm/config.py`); that of joint velocities at once,
from their differences, in which a slow motion cancels: HOLD with too little noise configured shakes the arm, and finds
no rest.
"""

from __future__ import annotations

import math
from enum import IntEnum, unique
from typing import Final, NamedTuple

import numpy as np

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Vec6, Whole, dtype_of
from slip_vic_controller.sizes import MAX_JOINTS, NEVER, Joints

LEAST_SAMPLES: Final = 5
"""Samples of a sensor without which its mean says nothing."""
MOST_VELOCITY_BIAS, STILL = 0.02, 0.01
"""Largest bias of a joint velocity that is taken out, and mean speed of a joint, by its positions, above which the arm
is not at rest [rad/s]."""
MOVED: Final = 0.02
"""Motion of a joint during a tare that ends it: by what the model of the arm, its drives or its load lacks [rad]."""
OUTLIER: Final = 3.0
"""Distance of a slip velocity from the mean, over its bound, from which it is an outlier."""
SIGNIFICANT: Final = 4.0
"""Standard deviations of a mean from which it is a bias, and no noise."""
ROUGH: Final = 50
"""Differences of joint velocities whose spread is taken for noise, before the arm is at rest."""


@unique
class Sensor(IntEnum):
    """Which sensor a tare is about."""

    NONE = 0
    SLIP = 1
    WRENCH = 2
    JOINTS = 3
    MASS = 4


class TareConfig(Record):
    """Bounds of what may be taken out."""

    duration_ns: Whole  # of rest before the law begins; 0 = no tare
    joints: Whole
    slip_linear: Real  # m/s
    slip_angular: Real  # rad/s
    force: Real  # N
    torque: Real  # N m
    mass: Real  # kg, of the object
    mass_share: Real  # of it by which it may be wrong
    velocity: Real  # rad/s, of a joint
    still: Real  # rad/s, of a joint; above it the arm is not at rest


class Mean(Record):
    """Mean and spread of vectors (Welford)."""

    count: Whole
    average: Joints
    squares: Joints  # sum of squared differences from the mean


class Tare(Record):
    """What was measured at rest."""

    watched: Whole  # whether a tare runs
    watched_from: Joints  # rad, when it started
    begun_ns: Whole  # stamp of the first joint state at rest; NEVER before
    done: Whole
    position: Joints  # rad, then
    wrench_ns: Whole  # stamp of the last wrench that was taken in
    slip: Mean  # m/s, rad/s {ee}
    wrench: Mean  # N, N m {ee}, beyond the load of the resting object
    velocity: Mean  # rad/s
    change: Mean  # rad/s, of the joint velocities from one cycle to the next, at rest or not
    last_velocity: Joints  # rad/s
    rough: Whole  # whether `change` shows what noise the joint velocities have
    renewed: Whole  # of these changes, those that are not zero for all joints
    repeated: Whole  # zero changes in a row
    longest: Whole  # most of them in a row
    mass_share: Real  # of the object beyond the configured mass
    slip_bias: Vec6  # m/s, rad/s {ee}; taken out of the samples
    wrench_bias: Vec6  # N, N m {ee}
    velocity_bias: Joints  # rad/s
    sensor: Whole  # Sensor that is out of bounds
    worst: Real  # m/s, rad/s, N or N m, its bias; kg where it is the mass
    bound: Real  # kg: the configured mass


class TareVerdict(NamedTuple):
    """The sensor whose bias is out of bounds, Sensor.NONE where all are inside; its size and bound, and which axis."""

    sensor: int
    axis: int
    size: float
    bound: float


TARE_CONFIG, MEAN, TARE = dtype_of(TareConfig), dtype_of(Mean), dtype_of(Tare)


@part
def start_tare(state: Tare, never_ns: int) -> None:
    """Forget what was measured; never_ns: the stamp that stands for never [ns]."""
    state.begun_ns, state.done, state.wrench_ns, state.mass_share = never_ns, 0, never_ns, 0.0
    state.sensor, state.worst, state.bound = 0, 0.0, 0.0
    state.slip_bias[:], state.wrench_bias[:], state.velocity_bias[:] = 0.0, 0.0, 0.0
    forget_mean(state.slip)
    forget_mean(state.wrench)
    forget_mean(state.velocity)


@part
def is_unchecked(config: TareConfig, state: Tare) -> bool:
    """Return whether the sensors wait for a tare, or the last one did not pass."""
    return bool(config.duration_ns > 0 and (state.done == 0 or state.sensor != Sensor.NONE))


@part
def moved_joint(config: TareConfig, state: Tare, q: Array) -> int:
    """Return the first joint that has moved during the tare, -1 where none has; q: (n,) [rad]."""
    if state.watched != 0 and state.done == 0:
        for j in range(config.joints):
            if abs(q[j] - state.watched_from[j]) > MOVED:
                return j
    return -1


@part
def forget_mean(state: Mean) -> None:
    """Let a mean begin again."""
    state.count, state.average[:], state.squares[:] = 0, 0.0, 0.0


@part
def add(state: Mean, values: Array, n: int) -> None:
    """Take a sample (n,) into a mean."""
    state.count += 1
    for k in range(n):
        beyond = values[k] - state.average[k]
        state.average[k] += beyond / state.count
        state.squares[k] += beyond * (values[k] - state.average[k])


@part
def add_slip(config: TareConfig, state: Tare, twist: Array) -> None:
    """Take a slip velocity (6,) [m/s, rad/s] {ee} into its mean; an outlier takes one of those before away instead.

    So the mean is that of the majority, wherever it begins, and outliers widen no spread.

    Implements: ours, as R. S. Boyer and J S. Moore's majority vote, 1981.
    """
    slip, far = state.slip, False
    for k in range(6):
        bound = config.slip_linear if k < 3 else config.slip_angular
        far = far or abs(twist[k] - slip.average[k]) > OUTLIER * bound
    if slip.count == 0 or not far:
        add(slip, twist, 6)
        return
    slip.squares[:] *= (slip.count - 1) / slip.count
    slip.count -= 1
    if slip.count == 0:
        slip.average[:] = 0.0


@part
def add_velocities(config: TareConfig, state: Tare, qd: Array) -> None:
    """Take joint velocities (n,) [rad/s] into their mean, and their change since the cycle before into its own."""
    change = np.empty(MAX_JOINTS)
    for j in range(config.joints):
        change[j], state.last_velocity[j] = qd[j] - state.last_velocity[j], qd[j]
    add(state.velocity, qd, config.joints)
    if state.velocity.count > 1 and state.rough == 0:
        add(state.change, change, config.joints)
        repeats = not change[: config.joints].any()
        state.renewed += 0 if repeats else 1
        state.repeated = state.repeated + 1 if repeats else 0
        state.longest = max(state.longest, state.repeated)
        state.rough = 1 if state.change.count == ROUGH else 0


def periods_of_joints(state: Tare) -> int:
    """Return after how many cycles the joint velocities are new, where that is regular to one of them; else 1.

    An encoder that is read in steps repeats itself at rest, too, but for any time.
    """
    if state.renewed < LEAST_SAMPLES:
        return 1
    periods = round(state.change.count / state.renewed)
    return periods if state.longest <= periods else 1


@part
def at_rest(config: TareConfig, q: Array, q_before: Array, seconds: float) -> bool:
    """Return whether no joint moves: by its positions, because velocities may be what is wrong.

    q, q_before: (n,) [rad], `seconds` apart.
    """
    still = True
    for j in range(config.joints):
        still = still and abs(q[j] - q_before[j]) <= config.still * seconds
    return still


@part
def deviation(squares: float, count: int) -> float:
    """Return the standard deviation of a mean's samples; 0 for fewer than two."""
    return math.sqrt(squares / (count - 1)) if count > 1 else 0.0


@part
def largest(values: Array, first: int, last: int) -> tuple[int, float]:
    """Return index and size of the largest of values[first:last]."""
    axis, size = first, abs(values[first])
    for k in range(first + 1, last):
        if abs(values[k]) > size:
            axis, size = k, abs(values[k])
    return axis, size


@part
def bias_of(average: float, squares: float, count: int) -> float:
    """Return a mean where it is one, 0 where it is within what noise gives it."""
    if count < LEAST_SAMPLES or not abs(average) > SIGNIFICANT * deviation(squares, count) / math.sqrt(count):
        return 0.0
    return float(average)


@part
def leave_to_mass(config: TareConfig, state: Tare, weight: Array) -> float:
    """Take what another mass of the object explains off a mean wrench that is out of bounds; return its share.

    More than the configured share is left in the wrench. weight: model's load of the resting object (6,) [N, N m] {ee}.

    Implements: ours: the mean less rho weight, rho the projection of its force on that of the weight.
    """
    wrench, along, square = state.wrench, 0.0, 0.0
    if max(largest(wrench.average, 0, 3)[1] - config.force, largest(wrench.average, 3, 6)[1] - config.torque) <= 0.0:
        return 0.0
    for k in range(3):
        along += wrench.average[k] * weight[k]
        square += weight[k] * weight[k]
    share = along / square if square > 0.0 else 0.0
    state.mass_share = min(max(share, -config.mass_share), config.mass_share)
    for k in range(6):
        wrench.average[k] -= state.mass_share * weight[k]
    return share


@part
def leave_to_motion(config: TareConfig, state: Tare, now_ns: int, q: Array) -> None:
    """Take what the joints have moved by, as their positions (n,) [rad] show it, off the mean of their velocities.

    At rest means slower than `still`, which is more than a bias may be.
    """
    seconds = 1e-9 * (now_ns - state.begun_ns)
    for j in range(config.joints):
        state.velocity.average[j] -= (q[j] - state.position[j]) / seconds if seconds > 0.0 else 0.0


@part
def take_biases(config: TareConfig, state: Tare, weight: Array, now_ns: int, q: Array) -> None:
    """Take what was measured as biases, or name the sensor that is out of bounds.

    weight: see `leave_to_mass`; now_ns, q: of the last joint state (n,) [rad], see `leave_to_motion`.
    """
    share = leave_to_mass(config, state, weight)
    leave_to_motion(config, state, now_ns, q)
    verdict = judge_tare(config, state)
    state.done, state.sensor, state.worst, state.bound = 1, verdict.sensor, verdict.size, verdict.bound
    if verdict.sensor == Sensor.WRENCH and abs(share) > config.mass_share:
        for k in range(6):
            state.wrench.average[k] -= (share - state.mass_share) * weight[k]
        if judge_tare(config, state).sensor != Sensor.WRENCH:  # a weight, and nothing beside it
            state.sensor, state.worst, state.bound = Sensor.MASS.value, (1.0 + share) * config.mass, config.mass
    if verdict.sensor != Sensor.NONE:
        state.mass_share = 0.0
    else:
        for k in range(6):
            state.slip_bias[k] = bias_of(state.slip.average[k], state.slip.squares[k], state.slip.count)
            state.wrench_bias[k] = bias_of(state.wrench.average[k], state.wrench.squares[k], state.wrench.count)
        for j in range(config.joints):
            state.velocity_bias[j] = bias_of(state.velocity.average[j], state.velocity.squares[j], state.velocity.count)


@part
def rest_begins(config: TareConfig, state: Tare, now_ns: int, q: Array) -> None:
    """Begin to measure at a joint state."""
    start_tare(state, now_ns)
    state.wrench_ns = now_ns - 1
    for j in range(config.joints):
        state.position[j] = q[j]


@part
def measure_at_rest(config: TareConfig, state: Tare, now_ns: int, q: Array, qd: Array) -> bool:
    """Take the joints of a cycle at rest in, begin again where they move; return whether the time of rest is over.

    Args:
        config: bounds.
        state: changed.
        now_ns: stamp of the joint state.
        q, qd: as measured; (n,) [rad], [rad/s].
    """
    begun = state.begun_ns != NEVER and now_ns >= state.begun_ns
    if not begun or not at_rest(config, q, state.position, config.duration_ns * 1e-9):
        rest_begins(config, state, now_ns, q)
    add_velocities(config, state, qd)
    return now_ns - state.begun_ns >= config.duration_ns


@part
def measure_without_rest(config: TareConfig, state: Tare, qd: Array, wrong: bool) -> None:
    """Take in the joint velocities (n,) [rad/s] of a cycle that is no part of the rest: their changes show the noise.

    The time of rest starts again after it. wrong: whether joints were found to be measured wrongly; where that ended
    the rest, what was measured before is no noise: it hides every velocity for good.
    """
    if wrong and state.begun_ns != NEVER:
        state.rough, state.renewed, state.repeated, state.longest = 0, 0, 0, 0
        forget_mean(state.change)
        forget_mean(state.velocity)
    state.begun_ns = NEVER
    add_velocities(config, state, qd)


@part
def judge_tare(config: TareConfig, state: Tare) -> TareVerdict:
    """Return the first sensor whose mean is out of bounds; a sensor with too few samples is not judged.

    The bound grows by the mean's own uncertainty, three of its standard deviations: noise is no bias.
    """
    for group in range(3):
        six = state.slip if group == 0 else state.wrench
        if group < 2 and six.count >= LEAST_SAMPLES:
            for half in range(2):
                axis, size = largest(six.average, 3 * half, 3 * half + 3)
                if group == 0:
                    bound = config.slip_linear if half == 0 else config.slip_angular
                else:
                    bound = config.force if half == 0 else config.torque
                unsure = 3.0 * deviation(six.squares[axis], six.count) / math.sqrt(six.count)
                if size > bound + unsure:
                    return TareVerdict(group + 1, axis, size, bound)
        elif group == 2 and state.velocity.count >= LEAST_SAMPLES:
            axis, size = largest(state.velocity.average, 0, config.joints)
            unsure = 3.0 * deviation(state.velocity.squares[axis], state.velocity.count)
            if size > config.velocity + unsure / math.sqrt(state.velocity.count):
                return TareVerdict(0 + Sensor.JOINTS.value, axis, size, config.velocity)
    return TareVerdict(0 + Sensor.NONE.value, 0, 0.0, 0.0)
