"""The control law, Eq. (28), (29), and one evaluation of it: from motion, wrench and slip velocity to joint effort.

A cycle calls, in this order (all arguments are records by name, `samples` and `slips` arrays of them, one per contact):

    gains_at(ramp, stamp_ns, gains)                                                   # gains.py
    predict_motion(config, gains, arm, samples, slips, slip_twist, motion)            # only with an observer
    integrate_slips(config, samples, slips, dt, slips)                                # contact.py
    evaluate(config, arm, sample, memory, given)

with `given` a record that holds `gains`, `samples`, `slips` of this cycle, `reference`, `follow_error` (6,) {ee}, which
an observer adds to G^T a_o (zeros without), and `law`, the EVALUATION to fill; `samples[0].slip_twist` is the slip
velocity that the law shall use, measured or estimated. Nothing here knows of sensors, time or modes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from slip_core.arrays import Array
from slip_core.cholesky import LARGEST
from slip_core.compiled import part
from slip_core.records import REAL, WHOLE, layout, new, record
from slip_core.vectors import ZERO, Spatial, mat, put, put_mat, put_spatial, spatial, vec
from slip_vic_controller.law.attitude import LOG, RPY, T_e, attitude_error, on_error_axes
from slip_vic_controller.law.contact import CONTACT, G_T, Phi2, fill_contacts, slip_velocity
from slip_vic_controller.law.impedance import faded, limit_spin, slip_activation
from slip_vic_controller.law.internal import internal_wrench
from slip_vic_controller.law.object import ObjectMotion, object_motion
from slip_vic_controller.law.torque import TORQUE, joint_torque
from slip_vic_controller.params import ControllerParams
from slip_vic_controller.sizes import MAX_CONTACTS, MAX_JOINTS

LAW_CONFIG = layout(
    joints=WHOLE,
    contacts=WHOLE,
    attitude=WHOLE,
    feed_forward=WHOLE,
    nullspace_stiffness=REAL,
    nullspace_damping=REAL,
    sigma_min=REAL,
    most_damping=REAL,
    radius=REAL,
    effort_limit=(REAL, (MAX_JOINTS,)),
    contact=(CONTACT, MAX_CONTACTS),
)
"""What does not change: joints and contacts in use; attitude: LOG or RPY; feed_forward 0 or 1; null space [N m/rad],
[N m s/rad]; singularity policy: sigma_min of J and the largest damping [kg^-1/2]; torsional radius of the pads [m];
effort_limit [N m]; contacts."""

EVALUATION = layout(
    ok=WHOLE,
    near_singular_arm=WHOLE,
    near_singular_attitude=WHOLE,
    saturated_joints=WHOLE,
    gate=REAL,
    damping_squared=REAL,
    error_linear=REAL,
    error_angular=REAL,
    slip_speed=REAL,
    carried=(REAL, (3,)),
    v_s=(REAL, (6,)),
    w_o=(REAL, (3,)),
    r=(REAL, (3,)),
    h_o=(REAL, (6,)),
    a_o=(REAL, (6,)),
    follow=(REAL, (6,)),
    comp=(REAL, (6,)),
    gated=(REAL, (6,)),
    h_int=(REAL, (6,)),
    e=(REAL, (6,)),
    e_dot=(REAL, (6,)),
    K=(REAL, (6,)),
    D=(REAL, (6,)),
    Theta=(REAL, (6,)),
    Z=(REAL, (6,)),
    a_d=(REAL, (6,)),
    a_C=(REAL, (6,)),
    torque=TORQUE,
    effort=(REAL, (MAX_JOINTS,)),
    saturated=(WHOLE, (MAX_JOINTS,)),
)
"""Everything of one evaluation.

ok: every number is finite and every factor exists, else nothing here may be used; near_singular_*: which fallback was
at work; damping_squared: what was added to J B^-1 J^T; error_linear [m], error_angular [rad], slip_speed (linear)
[m/s]; carried: G^T a_o + Phi2, linear part [m/s^2] {w}. On pad axes {ee}: v_s to h_int,
see `Law` (w_o, r, h_o, a_o of its ObjectMotion). On {w}: e to a_C; e, e_dot, K, D in the coordinates of the error.
torque: before the limits, with its parts; effort: inside them [N m]; saturated: which joints are beyond.
"""


class Law(NamedTuple):
    """Every symbol of the law; linear and angular part of each.

    On pad axes {ee}: v_s [m/s, rad/s]; object; follow = G^T a_o + Phi2, and comp and gated (gate times comp, spin
    limited) [m/s^2, rad/s^2]; h_int, the internal wrench of several contacts [N, N m]. On {w}: Theta,
    Z = T_e M_D^-1 (-K e - D e_dot), a_d, a_C. In the coordinates of the error: e [m, rad], e_dot, and the diagonals
    K, D. gate in [0, 1].
    """

    v_s: Spatial
    object: ObjectMotion
    follow: Spatial
    comp: Spatial
    gated: Spatial
    h_int: Spatial
    gate: float
    e: Spatial
    e_dot: Spatial
    K: Spatial
    D: Spatial
    Theta: Spatial
    Z: Spatial
    a_d: Spatial
    a_C: Spatial  # noqa: N815
    near_singular: bool


@part
def control_law(
    config: Any,
    gains: Any,
    arm: Any,
    samples: Any,
    follow_error: Array,
    e_previous: Array,
    slips: Any,
    reference: Any,
) -> Law:
    """Return a_C = a_d + T_e M_D^-1 [-K(v_s) e - D(v_s) edot] + Theta + gate comp, and all that it is made of.

    Args:
        config: LAW_CONFIG.
        gains: LAW_GAINS.
        arm: ARM.
        samples: CONTACT_SAMPLE of each contact.
        follow_error: what an observer adds to G^T a_o; (6,) [m/s^2, rad/s^2] {ee}.
        e_previous: orientation error one cycle earlier; (3,) [rad].
        slips: SLIP of each contact.
        reference: REFERENCE.

    With several contacts the pad gives way to its internal wrench, which the torque would cancel: ours.

    Implements: Eq. (23), (28), (29), with a_d of Eq. (23) outside of the gate.
    """
    R_ee, v_ee = mat(arm.rotation), spatial(arm.twist)
    R_d, v_d = mat(reference.rotation), spatial(reference.twist)
    a_d = config.feed_forward * spatial(reference.acceleration)
    slip_axes, k_s, M_D = spatial(config.contact[0].slip_axes), gains.gains.k_s, spatial(gains.gains.M_D)

    # the object, on pad axes
    v_s = slip_velocity(config.contact[0], samples[0])
    o = object_motion(config, gains, samples, slips, R_ee, v_ee.angular, v_s.angular)
    follow = G_T(o.r, o.a_o) + Phi2(o.w_o, o.r) + spatial(follow_error)

    # errors, on world axes
    attitude = attitude_error(config.attitude, R_ee, R_d, v_ee.angular, v_d.angular, a_d.angular, vec(e_previous))
    e = Spatial(vec(arm.position) - vec(reference.position), attitude.error)
    e_dot = Spatial(v_ee.linear - v_d.linear, attitude.rate)
    Theta = Spatial(ZERO, attitude.Theta)

    # impedance with fading gains, compensation
    v = on_error_axes(attitude, R_ee @ v_s)
    K, D = faded(gains.gains.K_D, gains.gains.gamma_k, v), faded(gains.gains.D_D, gains.gains.gamma_d, v)
    Z = T_e(attitude, -(K * e + D * e_dot) / M_D)
    gate = slip_activation(gains.gains, v_s)
    comp = slip_axes * (follow - k_s * v_s - R_ee.T() @ Theta)
    gated = limit_spin(gains.gains.spin_limit, gate * comp)
    a_C = a_d + Z + Theta + R_ee @ gated
    h_int = internal_wrench(config, gains, samples, slips, o)
    if gains.gains.kappa != 0.0:
        a_C = a_C + gains.gains.kappa * (R_ee @ h_int) / M_D
    return Law(v_s, o, follow, comp, gated, h_int, gate, e, e_dot, K, D, Theta, Z, a_d, a_C, attitude.near_singular)


@part
def evaluate(config: Any, arm: Any, sample: Any, memory: Any, given: Any) -> None:
    """Fill an EVALUATION: the law, the joint torque, and the effort inside its limits.

    Args:
        config, arm: LAW_CONFIG, ARM.
        sample: position and velocity of the joints; [rad], [rad/s].
        memory: posture of the null space [rad], and e_previous, for the branch of the orientation error: its value one
            cycle earlier, `evaluation.e[3:]` (zeros at first) [rad].
        given: gains, samples, follow_error, slips, reference, as of `control_law`, and law: the EVALUATION.

    Implements: Eq. (21), (28), (29), the whole law.
    """
    evaluation, samples, slips = given.law, given.samples, given.slips
    law = control_law(config, given.gains, arm, samples, given.follow_error, memory.e_previous, slips, given.reference)
    q, qd = sample.position, sample.velocity
    solved, damping_squared = joint_torque(config, arm, law.a_C, samples, q, qd, memory.posture, evaluation.torque)
    finite = clip_effort(config, evaluation) and finite_memory(config, law, slips)
    evaluation.ok = solved and finite
    evaluation.near_singular_arm, evaluation.damping_squared = damping_squared > 0.0, damping_squared
    put_law(evaluation, law)
    R_ee = mat(arm.rotation)
    put(evaluation.carried, R_ee @ law.follow.linear)


@part
def scale_acceleration(config: Any, arm: Any, sample: Any, memory: Any, factor: float, given: Any) -> None:
    """Command `factor` a_C instead of the a_C of an EVALUATION: torque and effort follow.

    Args:
        config, arm, sample, memory, given: as of `evaluate`.
        factor: of a guard, in [0, 1].
    """
    evaluation, q, qd = given.law, sample.position, sample.velocity
    a_C = factor * spatial(evaluation.a_C)
    put_spatial(evaluation.a_C, a_C)
    solved, _ = joint_torque(config, arm, a_C, given.samples, q, qd, memory.posture, evaluation.torque)
    evaluation.ok = clip_effort(config, evaluation) and solved and evaluation.ok != 0


@part
def put_law(out: Any, law: Law) -> None:
    """Write the symbols of the law to an EVALUATION."""
    out.near_singular_attitude, out.gate = law.near_singular, law.gate
    out.error_linear, out.error_angular = law.e.linear.norm(), law.e.angular.norm()
    out.slip_speed = law.v_s.linear.norm()
    put_spatial(out.v_s, law.v_s)
    put(out.w_o, law.object.w_o)
    put(out.r, law.object.r)
    put_spatial(out.h_o, law.object.h_o)
    put_spatial(out.a_o, law.object.a_o)
    put_spatial(out.follow, law.follow)
    put_spatial(out.comp, law.comp)
    put_spatial(out.gated, law.gated)
    put_spatial(out.h_int, law.h_int)
    put_spatial(out.e, law.e)
    put_spatial(out.e_dot, law.e_dot)
    put_spatial(out.K, law.K)
    put_spatial(out.D, law.D)
    put_spatial(out.Theta, law.Theta)
    put_spatial(out.Z, law.Z)
    put_spatial(out.a_d, law.a_d)
    put_spatial(out.a_C, law.a_C)


@part
def clip_effort(config: Any, out: Any) -> bool:
    """Write the effort inside the limits, and which joints are beyond; return whether every torque is finite."""
    out.saturated_joints = 0
    finite = True
    for j in range(config.joints):
        tau, limit = out.torque.tau[j], config.effort_limit[j]
        out.saturated[j] = abs(tau) > limit
        out.saturated_joints += out.saturated[j]
        out.effort[j] = min(max(tau, -limit), limit)
        finite = finite and abs(tau) <= LARGEST
    return finite


@part
def finite_memory(config: Any, law: Law, slips: Any) -> bool:
    """Return whether what the next cycle needs is finite: the orientation error and the slip displacements."""
    finite = is_finite(law.e.angular.x) and is_finite(law.e.angular.y) and is_finite(law.e.angular.z)
    for i in range(config.contacts):
        for j in range(3):
            finite = finite and is_finite(slips[i].position[j])
            for k in range(3):
                finite = finite and is_finite(slips[i].rotation[j, k])
    return finite


@part
def is_finite(number: float) -> bool:
    """Return whether a number may be squared."""
    return abs(number) <= LARGEST


@part
def predict_motion(config: Any, gains: Any, arm: Any, samples: Any, slips: Any, slip_twist: Array, motion: Any) -> bool:
    """Write what an observer is told of the object's motion; return whether every sample is finite.

    Args:
        config: LAW_CONFIG.
        gains: LAW_GAINS.
        arm: ARM.
        samples: CONTACT_SAMPLE of each contact.
        slips: SLIP of each contact, before the slip of this cycle is known.
        slip_twist: v_s that the observer knows; (6,) [m/s, rad/s] {ee}.
        motion: rotation R_ee; v_ee; follow = G^T a_o + Phi2 and force = G^T a_o - gravity (6,); drag = -f_ee / m and
            w_o (3,); all {w}.

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
        for j in range(6):
            finite = finite and is_finite(samples[i].wrench[j]) and is_finite(samples[i].slip_twist[j])
    return finite


def make_law_config(params: ControllerParams, effort_limit: Array) -> Array:
    """Return the LAW_CONFIG of the parameters; effort_limit (n,) [N m]."""
    buffer = new(LAW_CONFIG)
    config = record(buffer, LAW_CONFIG)
    config.joints = len(effort_limit)
    config.contacts = fill_contacts(params.contacts, config.contact)
    config.attitude = RPY if params.attitude == "rpy" else LOG
    config.feed_forward = params.feed_forward
    config.nullspace_stiffness, config.nullspace_damping = params.nullspace.stiffness, params.nullspace.damping
    config.radius = params.governor.torsional_radius
    config.sigma_min, config.most_damping = params.singularity.sigma_min, params.singularity.damping
    config.effort_limit[: len(effort_limit)] = effort_limit
    return buffer
