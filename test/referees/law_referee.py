"""A slow second implementation of the law, written straight from the equations with explicit matrices and inverses.

Own rotation maths (matrix power series and SciPy's rotation vectors), 6x6 matrices everywhere; nothing is shared
with the package under test but the shape of the input. Below the law stand the statements of the paper that the law
does not evaluate: the parts of the grasp matrix, slip acceleration, and how the Lyapunov functions change.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

SERIES_TERMS = 60


def S(v: np.ndarray) -> np.ndarray:
    return np.cross(np.eye(3), v)


def exponential(phi: np.ndarray) -> np.ndarray:
    return expm(S(phi))


def logarithm(R: np.ndarray) -> np.ndarray:
    return Rotation.from_matrix(R).as_rotvec()


def on_branch(e: np.ndarray, previous: np.ndarray) -> np.ndarray:
    """Return the rotation vector of the same rotation on the branch of the last one, up to three quarters of a turn."""
    other = e - 2.0 * np.pi * e / np.linalg.norm(e) if e.any() else e
    return other if np.linalg.norm(other) < 1.5 * np.pi and e @ previous < 0.0 else e


def jacobian_series(phi: np.ndarray, phi_dot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return J = sum S^k / (k + 1)! and its time derivative by the product rule on every power."""
    J, J_dot = np.eye(3), np.zeros((3, 3))
    power, power_dot, factorial = np.eye(3), np.zeros((3, 3)), 1.0
    for k in range(1, SERIES_TERMS):
        power_dot = power_dot @ S(phi) + power @ S(phi_dot)
        power = power @ S(phi)
        factorial *= k + 1
        J, J_dot = J + power / factorial, J_dot + power_dot / factorial
    return J, J_dot


def about(axis: int, angle: float) -> np.ndarray:
    return exponential(angle * np.eye(3)[axis])


def rpy_matrices(phi: np.ndarray, phi_dot: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return E and E_dot from the turning axes: roll about Rz Ry x, pitch about Rz y, yaw about z."""
    x, y, z = np.eye(3)
    Rz, Ry = about(2, phi[2]), about(1, phi[1])
    w_z = phi_dot[2] * z
    w_zy = w_z + phi_dot[1] * Rz @ y
    axes = [Rz @ Ry @ x, Rz @ y, z]
    rates = [np.cross(w_zy, axes[0]), np.cross(w_z, axes[1]), np.zeros(3)]
    return np.column_stack(axes), np.column_stack(rates)


def rpy_angles(R: np.ndarray) -> np.ndarray:
    return np.array([np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(R[2, 0]), np.arctan2(R[1, 0], R[0, 0])])


def two(R: np.ndarray) -> np.ndarray:
    """Return diag(R, R)."""
    return np.kron(np.eye(2), R)


@dataclass
class RefereeInput:
    """Everything the law needs, in plain arrays; object: mass, inertia, gravity; gains by their names in the law."""

    arm: Any
    reference: Any
    wrenches: list[np.ndarray]
    slip_twist: np.ndarray
    slip_positions: list[np.ndarray]
    slip_rotations: list[np.ndarray]
    contact_positions: list[np.ndarray]
    contact_rotations: list[np.ndarray]
    slip_axes: np.ndarray
    object: Any
    gains: Any
    attitude: str
    tau_0: np.ndarray
    previous: np.ndarray
    follow_error: np.ndarray
    sigma_min: float
    most_damping: float
    radius: float


def referee_law(given: RefereeInput) -> dict[str, np.ndarray]:
    """Return every symbol of the law by name."""
    arm, ref = given.arm, given.reference
    R, v_ee = arm.rotation, arm.twist
    v_s = two(R) @ given.slip_twist
    h = [None] * len(given.wrenches)
    h[0] = two(R) @ given.wrenches[0]

    R_o = R @ np.linalg.inv(given.contact_rotations[0] @ given.slip_rotations[0])
    placed = zip(given.contact_positions, given.contact_rotations, given.slip_positions, strict=True)
    G = [sum(grasp_matrix_parts(R_o, x_p, R_p, s_l)) for x_p, R_p, s_l in placed]
    for i in range(1, len(h)):
        h[i] = two(R_o @ given.contact_rotations[i] @ given.slip_rotations[i]) @ given.wrenches[i]
    r = R_o @ (given.contact_positions[0] + given.contact_rotations[0] @ given.slip_positions[0])

    zero = np.zeros((3, 3))
    J_o = R_o @ given.object.inertia @ np.linalg.inv(R_o)
    v_o = np.linalg.inv(G[0].T) @ (v_ee - v_s)
    w_o = v_o[3:]
    B_o = np.block([[given.object.mass * np.eye(3), zero], [zero, J_o]])
    C_o = np.block([[zero, zero], [zero, S(w_o) @ J_o]])
    g_o = np.concatenate((-given.object.mass * given.object.gravity, np.zeros(3)))
    h_o = sum(G_i @ h_i for G_i, h_i in zip(G, h, strict=True))
    P = G[0].T @ np.linalg.inv(B_o) @ C_o @ np.linalg.inv(G[0].T)
    Phi2 = np.concatenate((np.cross(w_o, np.cross(w_o, r)), np.zeros(3)))
    a_d = ref.acceleration

    w_ee, w_d = v_ee[3:], ref.twist[3:]
    if given.attitude == "log":
        R_e = R @ np.linalg.inv(ref.rotation)
        e_o = on_branch(logarithm(R_e), given.previous)
        w_e = w_ee - R_e @ w_d
        J, _ = jacobian_series(e_o, np.zeros(3))
        e_o_dot = np.linalg.inv(J) @ w_e
        _, J_dot = jacobian_series(e_o, e_o_dot)
        T, axes = J, np.eye(3)
        Theta_o = J_dot @ e_o_dot + np.cross(w_e, R_e @ w_d) + (R_e - np.eye(3)) @ a_d[3:]
    else:
        e_o = rpy_angles(np.linalg.inv(ref.rotation) @ R)
        E, _ = rpy_matrices(e_o, np.zeros(3))
        T, axes = ref.rotation @ E, ref.rotation
        e_o_dot = np.linalg.inv(T) @ (w_ee - w_d)
        _, E_dot = rpy_matrices(e_o, e_o_dot)
        Theta_o = (S(w_d) @ ref.rotation @ E + ref.rotation @ E_dot) @ e_o_dot
    T_e = np.block([[np.eye(3), zero], [zero, T]])
    Theta = np.concatenate((np.zeros(3), Theta_o))
    e = np.concatenate((arm.position - ref.position, e_o))
    e_dot = np.concatenate((v_ee[:3] - ref.twist[:3], e_o_dot))

    fade = np.concatenate((v_s[:3], np.linalg.inv(axes) @ v_s[3:]))
    K = np.diag([k * np.exp(-g * abs(v)) for k, g, v in zip(given.gains.K_D, given.gains.gamma_k, fade, strict=True)])
    D = np.diag([d * np.exp(-g * abs(v)) for d, g, v in zip(given.gains.D_D, given.gains.gamma_d, fade, strict=True)])
    M_D = np.diag(given.gains.M_D)
    gate = np.tanh(given.gains.alpha * np.linalg.norm(v_s * ([1.0] * 3 + [given.gains.characteristic_length] * 3)))
    comp = Phi2 - given.gains.k_s * v_s - P @ (v_ee - v_s) - G[0].T @ np.linalg.inv(B_o) @ (g_o + h_o) - Theta
    comp = comp + two(R) @ given.follow_error
    mask = two(R) @ np.diag(given.slip_axes) @ np.linalg.inv(two(R))
    gated = gate * (mask @ comp)
    gated[3:] *= min(1.0, given.gains.spin_limit / max(float(np.linalg.norm(gated[3:])), 1e-300))
    Lambda = M_D @ np.linalg.inv(T_e) @ gated
    a_C = a_d + T_e @ np.linalg.inv(M_D) @ (-K @ e - D @ e_dot + Lambda) + Theta
    W = np.diag([1.0] * 3 + [given.radius**2] * 3)
    h_int = h[0] - W @ G[0].T @ np.linalg.inv(sum(G_i @ W @ G_i.T for G_i in G)) @ h_o
    a_C = a_C + given.gains.kappa * np.linalg.inv(M_D) @ h_int

    B_inv = np.linalg.inv(arm.M)
    rows = given_rows(arm.J, given.sigma_min)
    J_t = arm.J[rows]
    sigma = np.linalg.svd(J_t, compute_uv=False)[-1] if J_t.shape[1] >= len(rows) else 0.0
    damping = given.most_damping * (1.0 - (sigma / given.sigma_min) ** 2) if sigma < given.sigma_min else 0.0
    B_x = np.linalg.inv(J_t @ B_inv @ J_t.T + damping**2 * np.eye(len(rows)))
    N = np.eye(len(arm.M)) - B_inv @ J_t.T @ B_x @ J_t
    tau = J_t.T @ B_x @ (a_C - arm.jdot_qd)[rows] - arm.J.T @ h[0] + arm.bias + N.T @ given.tau_0
    Z = T_e @ np.linalg.inv(M_D) @ (-K @ e - D @ e_dot)
    return {
        "Z": Z, "a_d": a_d, "sigma_min": sigma, "damping_squared": damping**2,
        "tau_task": tau - arm.bias - N.T @ given.tau_0,
        "V_e": 0.5 * (e_dot @ M_D @ e_dot + e @ np.diag(given.gains.K_D) @ e), "V_s": 0.5 * v_s @ v_s, "w_o": w_o,
        "follow": -P @ (v_ee - v_s) - G[0].T @ np.linalg.inv(B_o) @ (g_o + h_o), "T_e": T_e,
        "v_s": v_s, "h_ee": h[0], "R_o": R_o, "r": r, "v_o": v_o, "h_o": h_o, "P": P, "G": G[0], "Phi2": Phi2, "e": e,
        "e_dot": e_dot, "K": np.diag(K), "D": np.diag(D), "gate": gate, "comp": mask @ comp, "Lambda": Lambda,
        "Theta": Theta, "a_C": a_C, "tau": tau, "tau_null": N.T @ given.tau_0,
        "h_int": h_int, "a_o": -np.linalg.inv(B_o) @ (C_o @ v_o + g_o + h_o),
    }  # fmt: skip


def given_rows(J: np.ndarray, least: float) -> list[int]:
    """Return the directions that an arm with fewer than six joints gives: x, y, z and rotations that add `least`."""
    rows: list[int] = []
    for i in range(6):
        others = J[rows].T
        rest = J[i] - others @ np.linalg.lstsq(others, J[i], rcond=None)[0] if rows else J[i]
        if J.shape[1] >= 6 or i < 3 or np.linalg.norm(rest) >= least:
            rows.append(i)
    return rows


def grasp_matrix_parts(
    R_o: np.ndarray, x_p: np.ndarray, R_p: np.ndarray, s_l: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return G_C and G_s of Eq. (18): the part that stays and the part that slip changes."""
    zero = np.zeros((3, 3))
    constant = np.block([[np.eye(3), zero], [S(R_o @ x_p), np.eye(3)]])
    return constant, np.block([[zero, zero], [S(R_o @ R_p @ s_l), zero]])


def Phi1(w_o: np.ndarray) -> np.ndarray:
    """Return Phi1' of Eq. (20)."""
    zero = np.zeros((3, 3))
    return np.block([[2.0 * S(w_o), zero], [zero, S(w_o)]])


def slip_acceleration(
    a_ee: np.ndarray, follow: np.ndarray, w_o: np.ndarray, v_s: np.ndarray, Phi2: np.ndarray
) -> np.ndarray:
    """Return a_s of Eq. (19); follow = G^T a_o."""
    return a_ee - follow - Phi1(w_o) @ v_s - Phi2


def V_e_dot(D_D: np.ndarray, e_dot: np.ndarray, Lambda: np.ndarray) -> float:
    """Return the change of V_e with constant K and D, Eq. (26)."""
    return float(e_dot @ (Lambda - D_D * e_dot))


def V_s_dot(k_s: float, v_s: np.ndarray, Z: np.ndarray) -> float:
    """Return the change of V_s with the gate open, Eq. (34); Z with a_d, T_e M_D^-1 (-K e - D edot) + a_d."""
    return float(v_s @ (Z - k_s * v_s))
