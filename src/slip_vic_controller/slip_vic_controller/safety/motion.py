"""What only motion and slip tell: an object that falls, and a commanded motion that does not happen.

Following a falling object is the law's natural behaviour. So what counts as falling is not slip, which the law keeps
small, but the object's speed along gravity beyond the reference's, while there is slip. It is the speed of the pad
less the slip velocity, so neither the object's mass nor the wrench can make a fall of what is none.

A motion does not happen for friction of a joint, a brake, or something in the way.
"""

from __future__ import annotations

import math
from typing import Final

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Vec3, Vec6, Whole
from slip_core.vectors import mat, vec
from slip_vic_controller.arm.tare import OUTLIER
from slip_vic_controller.law.arm import Arm, DesiredMotion
from slip_vic_controller.law.evaluation import Evaluation
from slip_vic_controller.path.path_scaling import scale_for_error
from slip_vic_controller.safety.conditions import NOTHING, Reason, Why

FALLS_WITHIN_S = 0.06
"""Least time in which an object gains the speed of a fall: one wrong slip sample is none [s]."""
MOVING = 0.01
"""[m/s] or [rad/s] above which a reference requires motion, and a slip velocity counts as slip."""
FAR, FAR_TURNED = 0.01, 0.05
"""Distance from the reference at which an arm that rests does not follow it [m], [rad]."""
LEAST_TORQUE: Final = 0.05
"""Torque without effect that is friction: an object of another weight balances an arm far off, too [N m]."""
RESTS: Final = 1e-3
"""Speed of a pad that rests [m/s]."""


class DropDetectionConfig(Record):
    """What counts as a fall, and as a path that waits."""

    down: Vec3  # unit vector along gravity {w}, zeros without gravity
    drop_speed: Real  # m/s
    memory_s: Real  # s; least time in which that is gained
    error_linear: Real  # m; error at which the path stops
    error_angular: Real  # rad


class ObservedMotion(Record):
    """What the last evaluation of the law looked like."""

    fall_speed: Real  # m/s; of the object
    path_speed: Real  # how fast the path may run, share of planned
    moves: Whole  # whether the reference moves
    twist: Vec6  # m/s, rad/s {w}; of the pad


@part
def forget(state: ObservedMotion) -> None:
    """Restart: nothing has been seen."""
    state.fall_speed, state.path_speed, state.moves = 0.0, 1.0, 0
    state.twist[:] = 0.0


@part
def observe_motion(
    config: DropDetectionConfig, axes: Array, state: ObservedMotion, arm: Arm, law: Evaluation,
    reference: DesiredMotion, dt: float,
) -> None:  # fmt: skip
    """Look at what the law saw: errors, and a fall.

    Args:
        config: what counts as a fall.
        axes: directions of slip; (6,) 0 or 1 on pad axes.
        state: changed.
        arm, law, reference: of this cycle.
        dt: since the cycle before [s].
    """
    R, axes_linear = mat(arm.rotation), vec(axes)
    slipping = 1.0 if law.slip_speed > MOVING else law.gate
    beyond = vec(arm.twist) - R @ (axes_linear * vec(law.v_s)) - vec(reference.twist)
    down = R @ (axes_linear * (R.T() @ vec(config.down)))  # in the directions in which the contact can slip
    fall = slipping * down.dot(beyond)
    state.fall_speed = max(0.0, min(fall, state.fall_speed + dt * config.drop_speed / config.memory_s))
    state.path_speed = scale_for_error(law.error_linear, law.error_angular, config.error_linear, config.error_angular)
    v_d, w_d = vec(reference.twist), vec(reference.twist[3:])
    state.moves = 1 if v_d.dot(v_d) + w_d.dot(w_d) > MOVING * MOVING else 0
    state.twist[:] = arm.twist


@part
def doubt_of_fall(variance: Array) -> float:
    """Return the speed [m/s] by which an estimated slip velocity may be off; variance: (6,) of its axes."""
    return OUTLIER * math.sqrt(max(variance[0], variance[1], variance[2]))


@part
def rests_far_off(law: Evaluation, twist: Array) -> bool:
    """Return whether the pad rests far from its reference; twist: of the pad {w} (6,) [m/s, rad/s]."""
    far = law.error_linear > FAR or law.error_angular > FAR_TURNED
    return bool(far and vec(twist).norm() <= RESTS)


@part
def what_keeps(n: int, arm: Arm, law: Evaluation, h: Array, effort: Array, commanded: Array) -> Why:
    """Return which joint keeps an arm far from its reference, NOTHING where the torques are balanced.

    It is the one that the fastest command does not move, or with an effort interface most torque: inertia couples
    the joints, so that the largest torque need not be that of the blocked one.

    Args:
        n: number of joints.
        arm, law: of this cycle.
        h: wrench on the pad {w}; (6,) [N, N m].
        effort: that the joints have; (n,) [N m].
        commanded: velocities that drives with loops of their own are commanded; (n,) [rad/s], of others zeros.
    """
    joint, unmoved, most = 0, 0.0, -1.0
    for j in range(n):
        torque = effort[j] - arm.bias[j]
        for i in range(6):
            torque += arm.J[i, j] * h[i]
        against = abs(commanded[j]) if commanded.any() else abs(torque)
        if against > most:
            most, joint, unmoved = against, j, torque
    error = law.error_linear if law.error_linear > FAR else law.error_angular
    found = Why(Reason.NOT_FOLLOWING.value, 0, 0, joint, unmoved, error)
    return found if abs(unmoved) > LEAST_TORQUE else NOTHING
