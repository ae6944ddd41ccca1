"""The control law once, on arrays: no parameter models, no session, no modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.records import Record, Vec3, dtype_of, layout, new, record
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.attitude import Coordinates
from slip_vic_controller.law.config import LAW_CONFIG
from slip_vic_controller.law.contact import CONTACT_SAMPLE, SLIP
from slip_vic_controller.law.gains import LAW_GAINS
from slip_vic_controller.law.law import EVALUATION, evaluate
from slip_vic_controller.path.paths import REFERENCE
from slip_vic_controller.safety.validation import JOINT_SAMPLE
from slip_vic_controller.sizes import MAX_CONTACTS, MAX_JOINTS, Joints

EVERYTHING: Final = (1.0,) * 6
GRAVITY: Final = (0.0, 0.0, -9.81)


class LawMemory(Record):
    """What an evaluation takes of the one before."""

    posture: Joints  # rad; of the null space
    e_previous: Vec3  # rad; orientation error one cycle earlier


MEMORY = dtype_of(LawMemory)
GIVEN = layout([
    ("gains", LAW_GAINS), ("samples", CONTACT_SAMPLE, MAX_CONTACTS), ("slips", SLIP, MAX_CONTACTS),
    ("reference", REFERENCE), ("follow_error", "f8", 6), ("law", EVALUATION),
])  # fmt: skip


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What the law gives at one state; six numbers each, linear part first, unless stated otherwise.

    effort (n,) [N m] inside of its limits; acceleration a_C {w}; e, e_dot, K, D: error, its rate, faded stiffness and
    damping, in the coordinates of the error; gate in [0, 1]: slip activation; compensation {ee}: what drives the slip
    to zero, before the gate; object_wrench h_o [N, N m], object_acceleration a_o {ee}; saturated (n,): joints at their
    limit.
    """

    effort: Array
    acceleration: Array
    e: Array
    e_dot: Array
    K: Array
    D: Array
    gate: float
    compensation: Array
    object_wrench: Array
    object_acceleration: Array
    saturated: Array


def evaluate_law(
    *,
    q: ArrayLike,
    qd: ArrayLike,
    J: ArrayLike,
    M: ArrayLike,
    bias: ArrayLike,
    position: ArrayLike,
    rotation: ArrayLike,
    desired_position: ArrayLike,
    desired_rotation: ArrayLike,
    wrench: ArrayLike,
    slip_velocity: ArrayLike,
    mass: float,
    inertia: ArrayLike,
    grasp_position: ArrayLike,
    stiffness: ArrayLike,
    damping: ArrayLike,
    desired_inertia: ArrayLike,
    gamma_k: ArrayLike = 0.0,
    gamma_d: ArrayLike = 0.0,
    alpha: float = 0.0,
    k_s: float = 0.0,
    grasp_rotation: ArrayLike | None = None,
    jdot_qd: ArrayLike = 0.0,
    desired_twist: ArrayLike = 0.0,
    desired_acceleration: ArrayLike = 0.0,
    slip_position: ArrayLike = 0.0,
    slip_rotation: ArrayLike | None = None,
    slip_axes: ArrayLike = EVERYTHING,
    gravity: ArrayLike = GRAVITY,
    effort_limit: ArrayLike = np.inf,
    posture: ArrayLike | None = None,
    nullspace_stiffness: float = 0.0,
    nullspace_damping: float = 0.0,
    sigma_min: float = 1e-3,
    most_damping: float = 0.1,
    spin_limit: float = np.inf,
    characteristic_length: float = 1.0,
    e_previous: ArrayLike = 0.0,
    attitude: Literal["log", "rpy"] = "log",
) -> Evaluation:
    """Return what the paper's law gives for one arm of n joints and one contact.

        answer = slip_vic.evaluate_law(q=q, qd=qd, J=J, M=M, bias=bias, position=p, rotation=R,
            desired_position=p_d, desired_rotation=R_d, wrench=h, slip_velocity=v_s,
            mass=0.5, inertia=np.diag([2e-3] * 3), grasp_position=[0.02, 0, 0],
            stiffness=[400] * 6, damping=[25] * 6, desired_inertia=[0.4] * 6,
            gamma_k=100, gamma_d=100, alpha=100, k_s=1000)
        answer.effort, answer.K, answer.gate

    Classical impedance control has gamma_k = gamma_d = alpha = 0, the defaults.

    Args:
        q, qd: joint positions and velocities; (n,) [rad], [rad/s].
        J, M, bias: Jacobian of {ee} (6, n) {w}, joint inertia (n, n) [kg m2], C qd + g (n,) [N m].
        position, rotation: pose of {ee}; (3,) [m], (3, 3) {w}.
        desired_position, desired_rotation, desired_twist, desired_acceleration: where it shall be; (3,), (3, 3), (6,),
            (6,) {w}.
        wrench: of the object on the pad; (6,) [N, N m] {ee}.
        slip_velocity: of the pad relative to the object under it; (6,) [m/s, rad/s] {ee}.
        mass, inertia: of the object; [kg], (3, 3) [kg m2] {o}.
        grasp_position, grasp_rotation: of the pad on the object; (3,) [m], (3, 3) {o}; None: the identity.
        stiffness, damping, desired_inertia: K_D, D_D, M_D; (6,) [N/m, N m/rad], [N s/m, N m s/rad], [kg, kg m2].
        gamma_k, gamma_d: how fast stiffness and damping fade with slip; (6,) or one number [s/m, s/rad].
        alpha, k_s: slip activation [s/m] and compensation [1/s].
        jdot_qd: J_dot qd; (6,) {w}.
        slip_position, slip_rotation: slip displacement so far; (3,) [m], (3, 3) {p}.
        slip_axes: directions on pad axes in which it can slip; (6,) 0 or 1 each.
        gravity: (3,) [m/s^2] {w}.
        effort_limit: (n,) or one number [N m].
        posture, nullspace_stiffness, nullspace_damping: of joints beyond six; (n,) [rad], [N m/rad], [N m s/rad].
        sigma_min, most_damping: smallest singular value of J below which the torque is damped; how much [kg^-1/2].
        spin_limit: most that the compensation may turn [rad/s^2].
        characteristic_length: makes turning a slip speed [m].
        e_previous: orientation error one cycle earlier, for its branch; (3,) [rad].
        attitude: logarithm or roll, pitch and yaw.

    Raises:
        InputError: a shape that does not fit, or numbers that give no finite effort.

    Implements: Eq. (21), (28), (29).
    """
    q = np.asarray(q, dtype=float)
    n = len(q)
    if not 1 <= n <= MAX_JOINTS:
        raise InputError("q", got=f"{n} joints", expected=f"1 to {MAX_JOINTS}")
    config, arm, joints, memory, given = (
        record(new(kind), kind) for kind in (LAW_CONFIG, ARM, JOINT_SAMPLE, MEMORY, GIVEN)
    )
    try:
        config.joints, config.contacts, config.attitude = n, 1, Coordinates[attitude.upper()].value
        config.radius = 1.0
        config.nullspace_stiffness, config.nullspace_damping = nullspace_stiffness, nullspace_damping
        config.sigma_min, config.most_damping = sigma_min, most_damping
        config.effort_limit[:n] = effort_limit
        contact = config.contact[0]
        contact.position[:], contact.slip_axes[:] = grasp_position, slip_axes
        contact.rotation[:] = np.eye(3) if grasp_rotation is None else grasp_rotation
        arm.position[:], arm.rotation[:], arm.jdot_qd[:] = position, rotation, jdot_qd
        arm.J[:, :n], arm.M[:n, :n], arm.bias[:n] = J, M, bias
        arm.twist[:] = arm.J[:, :n] @ np.asarray(qd, dtype=float)
        gains, body = given.gains.gains, given.gains.object
        gains.K_D[:], gains.D_D[:], gains.M_D[:] = stiffness, damping, desired_inertia
        gains.gamma_k[:], gains.gamma_d[:] = gamma_k, gamma_d
        gains.alpha, gains.k_s, gains.kappa = alpha, k_s, 0.0
        gains.characteristic_length, gains.spin_limit = characteristic_length, spin_limit
        body.mass, body.inertia[:], body.gravity[:] = mass, inertia, gravity
        given.gains.contact_position[:] = grasp_position
        given.samples[0].wrench[:], given.samples[0].slip_twist[:] = wrench, slip_velocity
        for slip in given.slips:
            slip.rotation[:] = np.eye(3)
        given.slips[0].position[:] = slip_position
        if slip_rotation is not None:
            given.slips[0].rotation[:] = slip_rotation
        reference = given.reference
        reference.position[:], reference.rotation[:] = desired_position, desired_rotation
        reference.twist[:], reference.acceleration[:] = desired_twist, desired_acceleration
        joints.position[:n], joints.velocity[:n] = q, qd
        memory.posture[:n], memory.e_previous[:] = q if posture is None else posture, e_previous
    except ValueError as error:
        raise InputError("evaluate_law", got=str(error), expected="the shapes that its docstring names") from None
    evaluate(config, arm, joints, memory, given)
    law = given.law
    if not law.ok:
        raise InputError("evaluate_law", got="numbers that give no finite effort", expected="finite numbers, M > 0")
    return Evaluation(
        effort=np.array(law.effort[:n]),
        acceleration=np.array(law.a_C),
        e=np.array(law.e),
        e_dot=np.array(law.e_dot),
        K=np.array(law.K),
        D=np.array(law.D),
        gate=float(law.gate),
        compensation=np.array(law.comp),
        object_wrench=np.array(law.h_o),
        object_acceleration=np.array(law.a_o),
        saturated=np.array(law.saturated[:n], dtype=bool),
    )
