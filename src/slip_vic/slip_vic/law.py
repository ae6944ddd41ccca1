"""The control law once, on arrays: no parameter models, no session, no modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from slip_core.arrays import Array
from slip_core.errors import InputError
from slip_core.records import POSE, layout, new, record
from slip_vic_controller.law.arm import ARM
from slip_vic_controller.law.attitude import Coordinates
from slip_vic_controller.law.config import LAW_CONFIG
from slip_vic_controller.law.contact import CONTACT_SAMPLE
from slip_vic_controller.law.evaluation import EVALUATION
from slip_vic_controller.law.gains import LAW_GAINS
from slip_vic_controller.law.law import evaluate
from slip_vic_controller.path.paths import REFERENCE
from slip_vic_controller.sizes import MAX_CONTACTS, MAX_JOINTS

EVERYTHING: Final = (1.0,) * 6
GRAVITY: Final = (0.0, 0.0, -9.81)
GIVEN = layout([
    ("gains", LAW_GAINS), ("samples", CONTACT_SAMPLE, MAX_CONTACTS), ("slips", POSE, MAX_CONTACTS),
    ("reference", REFERENCE), ("follow_error", "f8", 6), ("law", EVALUATION),
])  # fmt: skip


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What the law gives at one state; six numbers each, linear part first, unless stated otherwise.

    effort (n,) [N m]; acceleration a_C {w}; e, e_dot, K, D: error, its rate, faded stiffness and damping, in the
    coordinates of the error; gate in [0, 1]: slip activation; compensation {ee}: what drives the slip to zero, before
    the gate.
    """

    effort: Array
    acceleration: Array
    e: Array
    e_dot: Array
    K: Array
    D: Array
    gate: float
    compensation: Array


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
) -> Evaluation:
    """Return what the paper's law gives for one arm of n joints and one contact.

        answer = slip_vic.evaluate_law(q=q, qd=qd, J=J, M=M, bias=bias, position=p, rotation=R,
            desired_position=p_d, desired_rotation=R_d, wrench=h, slip_velocity=v_s,
            mass=0.5, inertia=np.diag([2e-3] * 3), grasp_position=[0.02, 0, 0],
            stiffness=[400] * 6, damping=[25] * 6, desired_inertia=[0.4] * 6,
            gamma_k=100, gamma_d=100, alpha=100, k_s=1000)
        answer.effort, answer.K, answer.gate

    Classical impedance control has gamma_k = gamma_d = alpha = 0, the defaults. The effort has no torques of the null
    space, no damping near singular postures, and no limits.

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

    Raises:
        InputError: a shape that does not fit, or numbers that give no finite effort.

    Implements: Eq. (21), (28), (29).
    """
    q = np.array(q, dtype=float)
    n = len(q)
    if not 1 <= n <= MAX_JOINTS:
        raise InputError("q", got=f"{n} joints", expected=f"1 to {MAX_JOINTS}")
    config, arm, given = (record(new(kind), kind) for kind in (LAW_CONFIG, ARM, GIVEN))
    try:
        config.joints, config.contacts, config.attitude = n, 1, Coordinates.LOG.value
        config.radius, config.effort_limit[:n] = 1.0, np.inf
        contact = config.contact[0]
        contact.position[:], contact.slip_axes[:] = grasp_position, slip_axes
        contact.rotation[:] = np.eye(3) if grasp_rotation is None else grasp_rotation
        arm.position[:], arm.rotation[:], arm.jdot_qd[:] = position, rotation, jdot_qd
        arm.J[:, :n], arm.M[:n, :n], arm.bias[:n] = J, M, bias
        velocity = np.array(qd, dtype=float)
        arm.twist[:] = arm.J[:, :n] @ velocity
        gains, body = given.gains.gains, given.gains.object
        gains.K_D[:], gains.D_D[:], gains.M_D[:] = stiffness, damping, desired_inertia
        gains.gamma_k[:], gains.gamma_d[:] = gamma_k, gamma_d
        gains.alpha, gains.k_s, gains.kappa = alpha, k_s, 0.0
        gains.characteristic_length, gains.spin_limit = 1.0, np.inf
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
    except ValueError as error:
        raise InputError("evaluate_law", got=str(error), expected="the shapes that its docstring names") from None
    evaluate(config, arm, q, velocity, q, np.zeros(3), given)
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
    )
