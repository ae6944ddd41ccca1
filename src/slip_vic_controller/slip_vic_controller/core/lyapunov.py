"""The paper's Lyapunov functions and how they change along the closed loop; for diagnosis and tests."""

from __future__ import annotations

from slip_core.arrays import Array


def V_e(M_D: Array, K_D: Array, e: Array, e_dot: Array) -> float:
    """Return 1/2 edot' M_D edot + 1/2 e' K_D e; (6,) each, diagonals as vectors -> [J].

    Implements: Eq. (24).
    """
    return 0.5 * float((M_D * e_dot).dot(e_dot) + (K_D * e).dot(e))


def V_e_dot(D_D: Array, e_dot: Array, Lambda: Array) -> float:
    """Return -edot' D_D edot + edot' Lambda, the change of V_e with constant K and D; (6,) each -> [W].

    Implements: Eq. (26).
    """
    return float(e_dot @ (Lambda - D_D * e_dot))


def V_s(v_s: Array) -> float:
    """Return 1/2 v_s' v_s; (6,) [m/s, rad/s].

    Implements: Eq. (30).
    """
    return 0.5 * float(v_s.dot(v_s))


def V_s_dot(k_s: float, v_s: Array, Z: Array) -> float:
    """Return -k_s v_s' v_s + v_s' Z, the change of V_s with the gate open; (6,) each.

    Z is what the impedance and the feed-forward still ask for: T_e M_D^-1 (-K e - D edot) + a_d.

    Implements: Eq. (34).
    """
    return float(v_s @ (Z - k_s * v_s))
