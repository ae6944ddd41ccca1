"""The control law: from motion, reference, wrenches and slip velocity to the control acceleration a_C.

Knows nothing of sensors: v_s is an argument, measured or estimated. All vectors in {w}, origin at the own contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from slip_core.arrays import Array, rotate6
from slip_vic_controller.core import grasp, impedance
from slip_vic_controller.core.attitude import AttitudeError
from slip_vic_controller.core.grasp import Contact, SlipDisplacement
from slip_vic_controller.core.impedance import Gains
from slip_vic_controller.core.object_dynamics import ObjectModel, object_acceleration


class GraspTerms(NamedTuple):
    """What the law knows of the object: R_o (3, 3); r (3,) [m]; v_o, h_o, a_o (6,) at the COM; Phi2, follow (6,).

    follow = G^T a_o, the object's acceleration carried to the own contact without the slip terms. All {w}.
    """

    R_o: Array
    r: Array
    v_o: Array
    h_o: Array
    a_o: Array
    Phi2: Array
    follow: Array


class LawTerms(NamedTuple):
    """Every symbol of the law; (6,) in {w}, e and e_dot in the coordinates of the error; K, D are diagonals.

    Z = T_e M_D^-1 (-K e - D e_dot); comp is after the projection on the slip axes; gate in [0, 1].
    """

    v_s: Array
    e: Array
    e_dot: Array
    K: Array
    D: Array
    gate: float
    comp: Array
    Lambda: Array
    Theta: Array
    Z: Array
    a_d: Array
    a_C: Array  # noqa: N815


def grasp_terms(
    model: ObjectModel,
    contacts: Sequence[Contact],
    slips: Sequence[SlipDisplacement],
    wrenches: Sequence[Array],
    R_ee: Array,
    v_ee: Array,
    v_s: Array,
) -> GraspTerms:
    """Return attitude, motion and acceleration of the object as seen from the own contact, number 0.

    Args:
        model: the object.
        contacts: all contacts on it.
        slips: their slip displacements.
        wrenches: h_ee,i of the object on each robot, in the axes of each pad; (6,) [N, N m] each.
        R_ee: attitude of the own pad; (3, 3).
        v_ee: its twist; (6,) [m/s, rad/s] {w}.
        v_s: slip velocity of the own contact; (6,) [m/s, rad/s] {w}.

    Implements: Eq. (10), (11), (14), (17): h_o = sum G_i h_ee,i, v_o = G^-T (v_ee - v_s), a_o, Phi2, G^T a_o.
    """
    R_o = grasp.object_rotation(R_ee, contacts[0], slips[0])
    r = grasp.contact_arm(R_o, contacts[0], slips[0])
    h_o = grasp.wrench_to_object(r, rotate6(R_ee, wrenches[0]))
    for contact, s, wrench in zip(contacts[1:], slips[1:], wrenches[1:], strict=True):
        r_i = grasp.contact_arm(R_o, contact, s)
        h_o += grasp.wrench_to_object(r_i, rotate6(grasp.pad_rotation(R_o, contact, s), wrench))
    v_o = grasp.to_object(r, v_ee - v_s)
    w_o = v_o[3:]
    a_o = object_acceleration(model, R_o, w_o, h_o)
    return GraspTerms(R_o, r, v_o, h_o, a_o, grasp.Phi2(w_o, r), grasp.to_contact(r, a_o))


def control_law(
    gains: Gains,
    slip_axes: Array,
    attitude: AttitudeError,
    e_p: Array,
    e_p_dot: Array,
    a_d: Array,
    R_ee: Array,
    v_s: Array,
    terms: GraspTerms,
) -> LawTerms:
    """Return a_C = a_d + T_e M_D^-1 [-K(v_s) e - D(v_s) edot] + Theta + gate comp, and all that it is made of.

    Args:
        gains: diagonals of K_D, D_D, M_D and the slip gains.
        slip_axes: where the contact can slip; (6,) 0 or 1 on pad axes.
        attitude: orientation error and its kinematics.
        e_p, e_p_dot: x_ee - x_d and its rate; (3,) [m], [m/s] {w}.
        a_d: desired acceleration, zero where feed-forward is off; (6,) [m/s^2, rad/s^2] {w}.
        R_ee: attitude of the pad; (3, 3).
        v_s: slip velocity; (6,) [m/s, rad/s] {w}.
        terms: object motion from `grasp_terms`.

    Implements: Eq. (28), (29), with a_d of Eq. (23).
    """
    e, e_dot = np.concatenate((e_p, attitude.error)), np.concatenate((e_p_dot, attitude.rate))
    fade = np.concatenate((v_s[:3], v_s[3:].dot(attitude.axes)))
    K = impedance.fading_gain(gains.K_D, gains.gamma_k, fade)
    D = impedance.fading_gain(gains.D_D, gains.gamma_d, fade)
    Z = impedance.impedance(gains, K, D, e, e_dot)
    Z[3:] = attitude.T_e.dot(Z[3:])
    Theta = np.concatenate((_ZERO, attitude.Theta))
    gate = impedance.gate(gains.alpha, v_s, gains.spin_lever)
    comp = impedance.compensation(gains.k_s, v_s, terms.Phi2, terms.follow, Theta)
    comp = impedance.project(R_ee, slip_axes, comp)
    gated = impedance.limit_spin(gains.spin_limit, gate * comp)
    a_C = a_d + Z + Theta + gated
    Lambda = gains.M_D * np.concatenate((gated[:3], attitude.T_e_inverse.dot(gated[3:])))
    return LawTerms(v_s, e, e_dot, K, D, gate, comp, Lambda, Theta, Z, a_d, a_C)


_ZERO = np.zeros(3)
_ZERO.setflags(write=False)
