"""Rigid-body dynamics of the grasped object about its centre of mass, world axes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv

from slip_core.arrays import Array, skew
from slip_vic_controller.core.grasp import Phi1, grasp_matrix
from slip_vic_controller.core.rotation import cross


class ObjectModel(NamedTuple):
    """What is known of the object: mass [kg]; inertia (3, 3) [kg m2] {o} about the COM; gravity (3,) [m/s^2] {w}."""

    mass: float
    inertia: Array
    gravity: Array


def object_acceleration(model: ObjectModel, R_o: Array, w_o: Array, h_o: Array) -> Array:
    """Return a_o = -B_o^-1 (C_o v_o + g_o + h_o); (6,) [m/s^2, rad/s^2] {w} at the COM.

    Args:
        model: mass, inertia and gravity.
        R_o: attitude of the object; (3, 3) {o} to {w}.
        w_o: its angular velocity; (3,) [rad/s] {w}.
        h_o: sum of G_i h_ee,i, what the object exerts on all pads; (6,) [N, N m] {w} at the COM.

    Implements: Eq. (10), solved for the acceleration.
    """
    J_o = R_o.dot(model.inertia).dot(R_o.T)
    torque = h_o[3:] + cross(w_o, J_o.dot(w_o))
    return np.concatenate((model.gravity - h_o[:3] / model.mass, -dposv(J_o, torque)[1]))


def B_o(model: ObjectModel, R_o: Array) -> Array:
    """Return the object's inertia matrix diag(m I, J_o); (6, 6) [kg, kg m2] {w}.

    Implements: Eq. (10), B_o.
    """
    out = np.zeros((6, 6))
    out[:3, :3] = model.mass * np.eye(3)
    out[3:, 3:] = R_o @ model.inertia @ R_o.T
    return out


def C_o(model: ObjectModel, R_o: Array, w_o: Array) -> Array:
    """Return the object's Coriolis matrix diag(0, S(w_o) J_o); (6, 6) {w}.

    Implements: Eq. (10), C_o.
    """
    out = np.zeros((6, 6))
    out[3:, 3:] = skew(w_o) @ R_o @ model.inertia @ R_o.T
    return out


def g_o(model: ObjectModel) -> Array:
    """Return the object's weight term (-m gravity, 0), upward for gravity down; (6,) [N, N m] {w}.

    Implements: Eq. (10), g_o.
    """
    out = np.zeros(6)
    out[:3] = -model.mass * model.gravity
    return out


def P(model: ObjectModel, R_o: Array, w_o: Array, r: Array) -> Array:
    """Return P = G^T B_o^-1 C_o G^-T; (6, 6) {w} at the contact.

    Implements: Eq. (20), P.
    """
    G = grasp_matrix(r)
    right = np.linalg.solve(B_o(model, R_o), C_o(model, R_o, w_o))
    return np.asarray(G.T @ np.linalg.solve(G, right.T).T)


def slip_acceleration(a_ee: Array, follow: Array, w_o: Array, v_s: Array, Phi2: Array) -> Array:
    """Return a_s = a_ee - G^T a_o - Phi1' v_s - Phi2; (6,) [m/s^2, rad/s^2] {w}; `follow` is G^T a_o.

    Implements: Eq. (19).
    """
    return a_ee - follow - Phi1(w_o) @ v_s - Phi2
