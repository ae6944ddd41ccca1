"""The control law, Eq. (28), (29), and one evaluation of it: from motion, wrench and slip velocity to joint effort.

A cycle calls, in this order (all arguments are records, `samples` and `slips` arrays of them, one per contact):

    gains_at(ramp, stamp_ns, gains)                                                   # gains.py
    predict_motion(config, gains, arm, samples, slips, slip_twist, motion)            # only with an observer
    integrate_slips(config, samples, slips, dt, slips)                                # contact.py
    evaluate(config, arm, q, qd, posture, e_previous, given)

with `given` a record that holds `gains`, `samples`, `slips` of this cycle, `reference`, `follow_error` (6,) {ee}, which
an observer adds to G^T a_o (zeros without), and `law`, the Evaluation to fill; `samples[0].slip_twist` is the slip
velocity that the law uses, measured or estimated. Nothing here depends on sensors, time or modes.
"""

from __future__ import annotations

from typing import Any, Protocol

from slip_core.arrays import Array
from slip_core.cholesky import LARGEST, all_finite
from slip_core.compiled import part
from slip_core.records import Pose, Records
from slip_core.vectors import ZERO, Spatial, mat, put, put_mat, put_spatial, spatial, vec
from slip_vic_controller.law.arm import Arm, DesiredMotion
from slip_vic_controller.law.attitude import attitude_error, on_error_axes
from slip_vic_controller.law.config import LawConfig
from slip_vic_controller.law.contact import G_T, ContactSample, Phi2, slip_velocity
from slip_vic_controller.law.evaluation import Evaluation
from slip_vic_controller.law.extensions import authority, fade_with_gate, limit_spin, slip_speed
from slip_vic_controller.law.gains import LawGains
from slip_vic_controller.law.object import internal_wrench, internal_yielding, object_motion
from slip_vic_controller.law.paper import compensation, control_acceleration, faded, impedance, slip_activation
from slip_vic_controller.law.torque import joint_torque


class Given(Protocol):
    """The inputs of an evaluation, and `law`, its result; see the module.

    follow_error (6,) [m/s^2, rad/s^2] is on {ee}.
    """

    follow_error: Array

    gains: LawGains
    samples: Records[ContactSample]
    slips: Records[Pose]
    reference: DesiredMotion
    law: Evaluation


@part
def control_law(config: LawConfig, arm: Arm, e_previous: Array, given: Given) -> Spatial:
    """Return a_C = a_d + T_e M_D^-1 [-K(v_s) e - D(v_s) edot] + Theta + gate comp; its parts go to `given.law`.

    Args:
        config: what does not change.
        arm: at this joint state.
        e_previous: orientation error one cycle earlier; (3,) [rad].
        given: gains, samples, slips, reference, follow_error; and the evaluation.

    Ours: the mask of slip axes, the bound on spin, authority (with `yields`), and with several contacts yielding to the
    internal wrench, which the torque would cancel.

    Implements: Eq. (23), (28), (29), with a_d of Eq. (23) outside of the gate.
    """
    gains, samples, slips, reference, out = given.gains, given.samples, given.slips, given.reference, given.law
    R_ee, v_ee = mat(arm.rotation), spatial(arm.twist)
    R_d, v_d = mat(reference.rotation), spatial(reference.twist)
    a_d = spatial(reference.acceleration)
    slip_axes = spatial(config.contact[0].slip_axes)

    # the object, on pad axes
    v_s = slip_velocity(config.contact[0], samples[0])
    o = object_motion(config, gains, samples, slips, R_ee, v_ee.angular, v_s.angular)
    follow = G_T(o.r, o.a_o) + Phi2(o.w_o, o.r) + spatial(given.follow_error)
    out.slip_speed = v_s.linear.norm()
    put_spatial(out.v_s, v_s)
    put(out.w_o, o.w_o)
    put(out.r, o.r)
    put_spatial(out.h_o, o.h_o)
    put_spatial(out.a_o, o.a_o)
    put_spatial(out.follow, follow)
    put(out.carried, R_ee @ follow.linear)

    # errors, on world axes
    attitude = attitude_error(config.attitude, R_ee, R_d, v_ee.angular, v_d.angular, a_d.angular, vec(e_previous))
    e = Spatial(vec(arm.position) - vec(reference.position), attitude.error)
    e_dot = Spatial(v_ee.linear - v_d.linear, attitude.rate)
    Theta = Spatial(ZERO, attitude.Theta)
    out.near_singular_attitude = attitude.near_singular
    out.error_linear, out.error_angular = e.linear.norm(), e.angular.norm()
    put_spatial(out.e, e)
    put_spatial(out.e_dot, e_dot)
    put_spatial(out.Theta, Theta)

    # impedance with fading gains
    v = on_error_axes(attitude, R_ee @ v_s)
    left = authority(config.yields, out.error_linear) if config.yields > 0.0 else 1.0
    v = left * v
    K, D = faded(gains.gains.K_D, gains.gains.gamma_k, v), faded(gains.gains.D_D, gains.gains.gamma_d, v)
    Z = impedance(attitude, gains.gains, K, D, e, e_dot)
    put_spatial(out.K, K)
    put_spatial(out.D, D)
    put_spatial(out.Z, Z)

    # compensation
    out.gate = left * slip_activation(gains.gains.alpha, slip_speed(gains.gains, v_s))
    comp = slip_axes * compensation(follow, gains.gains.k_s, v_s, R_ee.T() @ Theta)
    gated = limit_spin(gains.gains.spin_limit, out.gate * comp)
    a_C = control_acceleration(a_d, Z, Theta, R_ee @ gated)
    if config.yields > 0.0:
        a_C = a_C - fade_with_gate(R_ee, slip_axes, out.gate, a_d + Z)
    h_int = internal_wrench(config, gains, samples, slips, o)
    if gains.gains.kappa != 0.0:
        a_C = a_C + internal_yielding(gains.gains, R_ee @ h_int)
    put_spatial(out.comp, comp)
    put_spatial(out.gated, gated)
    put_spatial(out.h_int, h_int)
    put_spatial(out.a_d, a_d)
    put_spatial(out.a_C, a_C)
    return a_C


@part
def evaluate(config: LawConfig, arm: Arm, q: Array, qd: Array, posture: Array, e_previous: Array, given: Given) -> None:
    """Fill `given.law`: the law, the joint torque, and the effort inside its limits.

    Args:
        config: what does not change.
        arm: at this joint state.
        q, qd, posture: joint state and posture of the null space; [rad], [rad/s], [rad].
        e_previous, given: as in `control_law`.

    Implements: Eq. (21), (28), (29), the whole law.
    """
    evaluation = given.law
    a_C = control_law(config, arm, e_previous, given)
    solved, damping_squared = joint_torque(config, arm, a_C, given.samples, q, qd, posture, evaluation)
    finite = clip_effort(config, evaluation) and finite_memory(config, evaluation, given.slips)
    evaluation.ok = solved and finite
    evaluation.near_singular_arm, evaluation.damping_squared = damping_squared > 0.0, damping_squared


@part
def scale_acceleration(
    config: LawConfig, arm: Arm, q: Array, qd: Array, posture: Array, factor: float, given: Given
) -> None:
    """Command `factor` a_C instead of the a_C of an evaluation: torque and effort follow.

    Args:
        config, arm, q, qd, posture, given: as in `evaluate`.
        factor: of a guard, in [0, 1].
    """
    evaluation = given.law
    a_C = factor * spatial(evaluation.a_C)
    put_spatial(evaluation.a_C, a_C)
    solved, _ = joint_torque(config, arm, a_C, given.samples, q, qd, posture, evaluation)
    evaluation.ok = clip_effort(config, evaluation) and solved and evaluation.ok != 0


@part
def clip_effort(config: LawConfig, out: Evaluation) -> bool:
    """Write the effort inside the limits, and which joints are beyond; return whether every torque is finite."""
    finite = True
    for j in range(config.joints):
        tau, limit = out.tau[j], config.effort_limit[j]
        out.saturated[j] = abs(tau) > limit
        out.effort[j] = min(max(tau, -limit), limit)
        finite = finite and abs(tau) <= LARGEST
    return finite


@part
def finite_memory(config: LawConfig, law: Evaluation, slips: Records[Pose]) -> bool:
    """Return whether what the next cycle needs is finite: the orientation error and the slip displacements."""
    finite = all_finite(law.e[3:])
    for i in range(config.contacts):
        finite = finite and finite_pose(slips[i].position, slips[i].rotation)
    return finite


@part
def finite_pose(position: Array, rotation: Array) -> bool:
    """Return whether a pose (3,), (3, 3) is finite."""
    return all_finite(position) and all_finite(rotation[0]) and all_finite(rotation[1]) and all_finite(rotation[2])


@part
def predict_motion(
    config: LawConfig, gains: LawGains, arm: Arm, samples: Records[ContactSample], slips: Records[Pose],
    slip_twist: Array, motion: Any,
) -> bool:  # fmt: skip
    """Write the object's motion for an observer; return whether every sample is finite.

    Args:
        config: what does not change.
        gains: in effect.
        arm: at this joint state.
        samples: of each contact.
        slips: of each contact, before the slip of this cycle is known.
        slip_twist: v_s of the observer's last tick; (6,) [m/s, rad/s] {ee}.
        motion: result, the observer's record, all {w}: rotation R_ee; v_ee; follow = G^T a_o + Phi2 and force = G^T a_o
            - gravity (6,); drag = -f_ee / m and w_o (3,).

    Implements: Eq. (10), (14), (17), G^T a_o + Phi2.
    """
    R_ee, v_ee = mat(arm.rotation), spatial(arm.twist)
    o = object_motion(config, gains, samples, slips, R_ee, v_ee.angular, spatial(slip_twist).angular)
    follow = R_ee @ G_T(o.r, o.a_o)
    put_mat(motion.rotation, R_ee)
    put_spatial(motion.v_ee, v_ee)
    put_spatial(motion.follow, follow + R_ee @ Phi2(o.w_o, o.r))
    put_spatial(motion.force, follow - Spatial(vec(gains.object.gravity), ZERO))
    put(motion.drag, (-1.0 / gains.object.mass) * (R_ee @ vec(samples[0].wrench)))
    put(motion.w_o, R_ee @ o.w_o)
    finite = True
    for i in range(config.contacts):
        finite = finite and all_finite(samples[i].wrench) and all_finite(samples[i].slip_twist)
    return finite
