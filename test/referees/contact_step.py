"""Referee: one implicit friction step of a grasped object in numpy and scipy, written from the equations alone.

MuJoCo's own solver gives the mobility, matrices are inverted, roots are bracketed; no code of the suite.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np
from scipy.optimize import brentq


def curve(params, speed, normal_force):
    """F(s) of Coulomb's and Stribeck's law; LuGre slides on Stribeck's."""
    if params.model == "coulomb":
        return params.mu_k * normal_force
    hump = (params.mu_s - params.mu_k) * math.exp(-((speed / params.stribeck_velocity) ** 2))
    return (params.mu_k + hump) * normal_force + params.viscous * speed


def rigid_step(params, u_free, A_hat, normal_force):
    """Stick, or maximum dissipation with the speed that solves u = u_free + A_hat f_hat."""
    hold = np.linalg.solve(A_hat, u_free)
    if np.linalg.norm(hold) <= curve(params, 0.0, normal_force):
        return -hold
    eigenvalues, V = np.linalg.eigh(A_hat)
    free = V.T @ u_free

    def direction(speed):
        return free / (speed + curve(params, speed, normal_force) * eigenvalues)

    top = float(np.linalg.norm(u_free))
    speed = brentq(lambda s: 1.0 / np.linalg.norm(direction(s)) - 1.0, 1e-12 * top, top, xtol=1e-18, rtol=1e-15)
    return -curve(params, speed, normal_force) * (V @ direction(speed))


def bristle_step(params, u_free, A_hat, normal_force, dt, start):
    """Backward Euler of the bristles: kappa is the root of the flow rule; returns f_hat, u and z'."""
    k, d, c = params.lugre.stiffness, params.lugre.damping, params.viscous
    fraction = params.lugre.breakaway_fraction
    z = start * min(1.0, params.mu_s * normal_force / k / max(np.linalg.norm(start), 1e-300))

    def motion(kappa):
        """f_hat = -(k z' + d (z' - z) / dt + c u) with z' = kappa (z + dt u), put into u = u_free + A_hat f_hat."""
        pull = kappa * (k * dt + d) + c
        push = (k * kappa + d * (kappa - 1.0) / dt) * z
        u = np.linalg.solve(np.eye(3) + pull * A_hat, u_free - A_hat @ push)
        return u, kappa * (z + dt * u)

    def residual(kappa):
        u, z_next = motion(kappa)
        length = np.linalg.norm(z_next)
        dry = curve(params, float(np.linalg.norm(u)), normal_force) - c * np.linalg.norm(u)
        full = max(dry / k, 1e-12)
        if u @ z_next <= 0.0 or length <= fraction * full:
            return 1.0 - kappa
        middle = 0.5 * (1.0 + fraction)
        alpha = 1.0 if length >= full else 0.5 * (1.0 + math.sin(math.pi * (length / full - middle) / (1.0 - fraction)))
        return 1.0 - kappa * (1.0 + dt * alpha * (u @ z_next) / (length * full))

    kappa = 1.0 if residual(1.0) >= 0.0 else brentq(residual, 0.0, 1.0, xtol=1e-16, rtol=1e-14)
    u, z_next = motion(kappa)
    return -(k * z_next + d * (z_next - z) / dt + c * u), u, z_next


def joint_friction(model, data, params, effort, normal_force, dt, state):
    """Friction on the three relative joints in the coming step [N, N m], and the next state of the bristles."""
    friction, n = params.friction, len(effort)
    sides, solved = np.zeros((4, model.nv)), np.zeros((4, model.nv))
    sides[:3, n:] = np.eye(3)
    sides[3] = -data.qfrc_bias
    sides[3, :n] += effort
    mujoco.mj_solveM(model, data, solved, sides)
    x, y, _ = data.qpos[n:]
    J = np.array([[1.0, 0.0, y], [0.0, 1.0, -x], [0.0, 0.0, 1.0]])
    if normal_force <= 0.0:
        return np.zeros(3), np.zeros(3)
    S = np.diag([1.0, 1.0, friction.torsional_radius])
    A_hat = dt * S @ J @ solved[:3, n:] @ J.T @ S
    u_free = S @ J @ (data.qvel[n:] + dt * solved[3, n:])
    if friction.model != "lugre":
        return J.T @ S @ rigid_step(friction, u_free, A_hat, normal_force), np.zeros(3)
    f_hat, u, z = bristle_step(friction, u_free, A_hat, normal_force, dt, np.array(state))
    turn = dt * u[2] / friction.torsional_radius
    return J.T @ S @ f_hat, z + turn * np.array([-state[1], state[0], 0.0])
