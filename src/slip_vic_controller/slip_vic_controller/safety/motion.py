"""What only motion and slip show: an object that falls, and an error at which the path waits.

Following a falling object is the law's natural behaviour. So what counts as falling is not slip, which the law keeps
small, but the object's speed along gravity beyond the reference's, while there is slip. It is the speed of the pad
less the slip velocity, so neither the object's mass nor the wrench can make a fall of what is none.
"""

from __future__ import annotations

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.records import Real, Record, Vec3, Vec6, Whole
from slip_core.vectors import mat, vec
from slip_vic_controller.law.arm import Arm, DesiredMotion
from slip_vic_controller.law.evaluation import Evaluation
from slip_vic_controller.path.paths import scale_for_error

FALLS_WITHIN_S = 0.06
"""Least time in which an object gains the speed of a fall: one wrong slip sample is none [s]."""
MOVING = 0.01
"""[m/s] or [rad/s] above which a reference requires motion, and a slip velocity counts as slip."""


class DropDetectionConfig(Record):
    """What counts as a fall, and as a path that waits."""

    down: Vec3  # unit vector along gravity {w}, zeros without gravity
    drop_speed: Real  # m/s
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
    """Check the law's evaluation for errors and a fall.

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
    state.fall_speed = max(0.0, min(fall, state.fall_speed + dt * config.drop_speed / FALLS_WITHIN_S))
    state.path_speed = scale_for_error(law.error_linear, law.error_angular, config.error_linear, config.error_angular)
    v_d, w_d = vec(reference.twist), vec(reference.twist[3:])
    state.moves = 1 if v_d.dot(v_d) + w_d.dot(w_d) > MOVING * MOVING else 0
    state.twist[:] = arm.twist
