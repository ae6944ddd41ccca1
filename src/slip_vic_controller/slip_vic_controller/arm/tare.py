"""Tare at rest: readings of an arm's sensors without motion, before the law starts.

Nothing slips in HOLD, and the load of the resting object is known. So the mean of a slip sensor's samples is its bias,
the mean of the wrench beyond the model's load is that of the wrench sensor, and the spread of all is their noise. A
wrench that another mass of the object explains is that of another mass, and the law works with that mass. Until the
tare has passed the wrench is the model's: a sensor that was not checked moves no joint, and a joint that moves all the
same ends the tare in FAULT.
Biases inside the configured bounds are taken out; a larger one is a reason not to begin, with the sensor's name.
Noise that is larger than configured replaces what is configured (`config/noise.py`); that of joint velocities at once,
from their differences, in which a slow motion cancels: HOLD with too little noise configured shakes the arm, and finds
no rest.
"""

from __future__ import annotations

import math
from typing import Final

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Whole
from slip_core.vectors import Spatial, put_spatial, spatial
from slip_vic_controller.arm.estimator import BIAS, MOVES, SIGNIFICANT
from slip_vic_controller.safety.conditions import NOTHING, Reason, WhyRecord, find, put_why
from slip_vic_controller.sizes import NEVER, Joints

LEAST_SAMPLES: Final = 5
"""Samples of a sensor required for a mean."""
MOVED: Final = 0.02
"""Motion of a joint that ends a tare, from errors of the model of arm, drives or load [rad]."""
OUTLIER: Final = 3.0
"""Size of a slip velocity at rest, over its bound or its standard deviation, from which it is an outlier."""
ROUGH: Final = 50
"""Differences of joint velocities whose spread is taken for noise, before the arm is at rest."""


class TareConfig(Record):
    """Bounds of the biases that may be removed."""

    duration_ns: Whole  # of rest before the law begins; 0 = no tare
    joints: Whole
    slip_linear: Real  # m/s
    slip_angular: Real  # rad/s
    force: Real  # N
    torque: Real  # N m
    mass: Real  # kg, of the object
    mass_share: Real  # of it by which it may be wrong
    noise_velocity: Real  # rad/s; what is configured of the sensors' noise, standard deviations
    noise_linear: Real  # m/s; of slip
    noise_angular: Real  # rad/s
    noise_force: Real  # N
    noise_torque: Real  # N m


class Mean(Record):
    """Mean and spread of vectors (Welford)."""

    count: Whole
    average: Joints
    squares: Joints  # sum of squared differences from the mean
    bias: Joints  # what of the mean is taken out of the samples


class Tare(Record):
    """What was measured at rest."""

    watched: Whole  # whether a tare runs
    watched_from: Joints  # rad, when it started
    begun_ns: Whole  # stamp of the first joint state at rest; NEVER before
    done: Whole
    position: Joints  # rad, then
    wrench_ns: Whole  # stamp of the last wrench that was taken in
    slip: Mean  # m/s, rad/s {ee}
    slip_count: Whole  # of all samples
    slip_linear: Real  # m/s; mean size of them
    slip_angular: Real  # rad/s
    wrench: Mean  # N, N m {ee}, beyond the load of the resting object
    velocity: Mean  # rad/s
    change: Mean  # rad/s, of the joint velocities from one cycle to the next, at rest or not
    last_velocity: Joints  # rad/s
    rough: Whole  # whether `change` shows what noise the joint velocities have
    mass_share: Real  # of the object beyond the configured mass
    found: WhyRecord  # which sensor is out of bounds, or the mass


@part
def start_tare(state: Tare, begun_ns: int) -> None:
    """Clear the measurements; begun_ns: stamp of a joint state at rest, NEVER if there is none yet [ns]."""
    state.begun_ns, state.done, state.wrench_ns, state.mass_share = begun_ns, 0, begun_ns, 0.0
    state.slip_count, state.slip_linear, state.slip_angular = 0, 0.0, 0.0
    put_why(state.found, NOTHING)
    for mean in (state.slip, state.wrench, state.velocity):
        mean.count, mean.average[:], mean.squares[:], mean.bias[:] = 0, 0.0, 0.0, 0.0


@part
def moved_most(n: int, q: Array, before: Array, least: float) -> int:
    """Return the joint that is farthest from where it was, -1 where none is by more than `least`; (n,) [rad]."""
    found = -1
    for j in range(n):
        if abs(q[j] - before[j]) > least:
            found, least = j, abs(q[j] - before[j])
    return found


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
    """Take a slip velocity (6,) [m/s, rad/s] {ee} into its mean; an outlier widens no spread and moves no mean.

    It counts little in the mean size, too; but where every sample is one, as in another unit, that is beyond all
    bounds.
    """
    far, v = False, spatial(twist)
    state.slip_count += 1
    state.slip_linear += (min(v.linear.norm(), OUTLIER * config.slip_linear) - state.slip_linear) / state.slip_count
    state.slip_angular += (min(v.angular.norm(), OUTLIER * config.slip_angular) - state.slip_angular) / state.slip_count
    for k in range(6):
        bound = config.slip_linear if k < 3 else config.slip_angular
        far = far or abs(twist[k]) > OUTLIER * bound
    if not far:
        add(state.slip, twist, 6)


@part
def add_velocities(config: TareConfig, state: Tare, qd: Array) -> None:
    """Take joint velocities (n,) [rad/s] into their mean, and their change since the cycle before into its own."""
    add(state.velocity, qd, config.joints)
    if state.velocity.count > 1 and state.rough == 0:
        add(state.change, qd - state.last_velocity[: config.joints], config.joints)
        state.rough = 1 if state.change.count == ROUGH else 0
    state.last_velocity[: config.joints] = qd


@part
def deviation(mean: Mean, k: int) -> float:
    """Return the standard deviation of number k of a mean's samples; 0 for fewer than two."""
    return math.sqrt(mean.squares[k] / (mean.count - 1)) if mean.count > 1 else 0.0


@part
def exceeds(mean: Mean, k: int, bound: float) -> bool:
    """Return whether number k of a mean is beyond a bound by more than noise gives it; not for too few samples."""
    unsure = SIGNIFICANT * deviation(mean, k) / math.sqrt(max(mean.count, 1))
    return bool(mean.count >= LEAST_SAMPLES and abs(mean.average[k]) > bound + unsure)


@part
def judge_tare(config: TareConfig, state: Tare) -> bool:
    """Name the first sensor that is out of bounds, in the order of the words; return whether there is one.

    Of a slip sensor its mean size, which noise has too, of the others the mean.
    """
    biased = Reason.BIASED.value
    if state.slip_count >= LEAST_SAMPLES and state.slip_linear > config.slip_linear:
        find(state.found, biased, 0, state.slip_linear, config.slip_linear)
    if state.slip_count >= LEAST_SAMPLES and state.slip_angular > config.slip_angular:
        find(state.found, biased, 1, state.slip_angular, config.slip_angular)
    for k in range(6):
        bound = config.force if k < 3 else config.torque
        if exceeds(state.wrench, k, bound):
            find(state.found, biased, 2 + k // 3, abs(state.wrench.average[k]), bound)
    for j in range(config.joints):
        if exceeds(state.velocity, j, MOVES):
            find(state.found, biased, 4, abs(state.velocity.average[j]), MOVES)
    return bool(state.found.reason != Reason.NONE)


@part
def leave_to_mass(config: TareConfig, state: Tare, weight: Spatial) -> float:
    """Take what another mass of the object explains off a mean wrench that is out of bounds; return its share.

    weight: model's load of the resting object [N, N m] {ee}.

    Implements: ours: the mean less rho weight, rho the projection of its force on that of the weight.
    """
    wrench, out, square = spatial(state.wrench.average), False, weight.linear.dot(weight.linear)
    for k in range(6):
        out = out or abs(state.wrench.average[k]) > (config.force if k < 3 else config.torque)
    share = wrench.linear.dot(weight.linear) / square if out and square > 0.0 else 0.0
    put_spatial(state.wrench.average, wrench - share * weight)
    return share


@part
def take_biases(config: TareConfig, state: Tare, weight: Spatial, now_ns: int, q: Array) -> None:
    """Use the means as biases, or name the sensor that is out of bounds.

    What the joints have moved by, as their positions show it, is no bias of their velocities: at rest means slower
    than BIAS.

    Args:
        config, state: of the tare.
        weight: see `leave_to_mass`.
        now_ns, q: of the last joint state; (n,) [rad].
    """
    state.done, share, seconds = 1, leave_to_mass(config, state, weight), 1e-9 * (now_ns - state.begun_ns)
    for j in range(config.joints):
        state.velocity.average[j] -= (q[j] - state.position[j]) / seconds if seconds > 0.0 else 0.0
    if judge_tare(config, state):
        return
    if abs(share) > config.mass_share:
        reason = Reason.INVERTED_WRENCH.value if share < -1.0 else Reason.WRONG_MASS.value
        find(state.found, reason, 0, (1.0 + share) * config.mass, config.mass)
        return
    state.mass_share = share
    for mean in (state.slip, state.wrench, state.velocity):
        for k in range(mean.bias.size):
            mean.bias[k] = mean.average[k] if exceeds(mean, k, 0.0) else 0.0


@part
def measure_at_rest(config: TareConfig, state: Tare, now_ns: int, q: Array, qd: Array) -> bool:
    """Take the joints of a cycle at rest in, begin again where they move; return whether the time of rest is over.

    By their positions, because velocities may be what is wrong.

    Args:
        config: bounds.
        state: changed.
        now_ns: stamp of the joint state.
        q, qd: as measured; (n,) [rad], [rad/s].
    """
    begun, way = state.begun_ns != NEVER and now_ns >= state.begun_ns, BIAS * 1e-9 * config.duration_ns
    if not begun or moved_most(config.joints, q, state.position, way) >= 0:
        start_tare(state, now_ns)
        state.wrench_ns, state.position[: config.joints] = now_ns - 1, q
    add_velocities(config, state, qd)
    return now_ns - state.begun_ns >= config.duration_ns
