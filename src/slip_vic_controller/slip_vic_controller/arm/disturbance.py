"""Disturbance of the joints: what of it is taken off the effort, and when a jump of it is a collision."""

from __future__ import annotations

import math
from typing import Final

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_vic_controller.arm.estimator import LASTS_S, MEAN_S, contradiction, is_unmeasured
from slip_vic_controller.arm.joint_estimate import EstimatorConfig, JointEstimate, Trust, find
from slip_vic_controller.safety.conditions import Reason

SLOW_S: Final = 0.2
"""Time constant of the disturbance that is no collision [s]."""
WITH_WRENCH: Final = 0.5
"""Share of a jump of the disturbance from which the wrench that has jumped too explains it, ..."""
NOTICED: Final = 0.3
"""... where that is this share of what is a collision: an object that is accelerated jumps less. And share of the
parity that contradicts from which a jump may be a wrong measurement."""


@part
def disturbance(config: EstimatorConfig, state: JointEstimate, M: Array, j: int) -> float:
    """Return the disturbance M d of joint j [N m]; M: inertia (n, n) [kg m2]."""
    effort = 0.0
    for k in range(config.joints):
        effort += M[j, k] * state.d[k]
    return effort


@part
def oppose_disturbance(
    config: EstimatorConfig,
    state: JointEstimate,
    M: Array,
    of_wrench: Array,
    dt: float,
    judged: bool,
    torque: Array,
) -> None:
    """Take the disturbance off the effort, inside its bound and rate, and look for jumps and lasting excess.

    A wrench that is measured wrongly looks like a disturbance, since the joints do not feel it. So a disturbance that
    jumps together with the wrench is no collision, and is not taken off.

    Args:
        config: what does not change.
        state: changed.
        M: inertia (n, n) [kg m2].
        of_wrench: J^T h, torque of the measured wrench; (n,) [N m].
        dt: since the cycle before [s].
        judged: whether the noise of joint velocities is known by now; before, a jump may be noise.
        torque: changed; (n,) [N m].

    Implements: ours: tau -= M d.
    """
    n, weight, follow = config.joints, 1.0 - math.exp(-dt / SLOW_S), 1.0 - math.exp(-dt / config.settling)
    # The inertia carries a joint that is measured wrongly, or not at all, into the torques of the others.
    unmeasured = bool(state.unmeasured.max() >= config.sensor_ticks)
    doubtful = unmeasured or not judged
    for j in range(n):
        differs = contradiction(config, state, j) > NOTICED * config.difference
        doubtful = doubtful or state.trust[j] != Trust.BOTH or differs
    for j in range(n):
        effort = disturbance(config, state, M, j)
        if is_unmeasured(config, state, j):
            # What is known of it is its torque: the acceleration depends on the other joints, too.
            state.d[j] += (state.effort[j] - effort) / M[j, j]
            effort = state.effort[j]
        state.effort[j] = effort
        jump, wrench_jump = effort - state.slow_effort[j], of_wrench[j] - state.slow_wrench[j]
        state.wrench_jump[j] = max(abs(wrench_jump), (1.0 - weight) * state.wrench_jump[j])
        most = config.collision[j] + 2.0 * config.friction[j]  # which turns round
        with_wrench = state.wrench_jump[j] > max(WITH_WRENCH * abs(jump), NOTICED * config.collision[j])
        lasting = state.slow_effort[j] if with_wrench else effort
        # Neither low-pass may run to a wrench of some hundred newtons: it would get there in a few cycles.
        pull = NOTICED * config.collision[j] if with_wrench else math.inf
        state.slow_effort[j] += weight * min(max(jump, -pull), pull)
        state.slow_wrench[j] += weight * min(max(wrench_jump, -pull), pull)
        jumped = abs(jump) > most and not with_wrench and not doubtful
        state.jumped_s[j] = state.jumped_s[j] + dt if jumped else 0.0
        bound, step = config.bound[j], config.rate[j] * dt
        wanted = state.taken_off[j] if unmeasured else min(max(-lasting, -bound), bound)
        state.taken_off[j] += min(max(follow * (wanted - state.taken_off[j]), -step), step)
        torque[j] += state.taken_off[j]
        state.beyond_s[j] = state.beyond_s[j] + dt if abs(effort) > bound else 0.0
        if state.jumped_s[j] > MEAN_S:
            find(state, Reason.COLLISION.value, j, jump, most)
        elif state.beyond_s[j] > LASTS_S:
            find(state, Reason.DISTURBED.value, j, effort, bound)
