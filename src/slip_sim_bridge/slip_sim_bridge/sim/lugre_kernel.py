"""The bristles' step as parts of kernels: the formulas of `lugre.LuGre` once more; tests hold both equal.

Layout of `law`: see `friction_kernel`.
"""

from __future__ import annotations

import math

from slip_core.arrays import Array
from slip_core.compiled import part
from slip_core.sym3_kernel import Sym3, multiply_of, solve_of
from slip_core.vector_kernel import Three, norm
from slip_sim_bridge.sim.friction_kernel import BREAKAWAY, DAMPING, MU_S, STIFFNESS, VISCOUS, limit

ROOT_TOLERANCE = 1e-12  # of kappa
ROOT_ITERATIONS = 100
SHORTEST = 1e-12  # m: full stretch where there is no dry friction; its force is nil


@part
def shortened(law: Array, z: Three, normal_force: float) -> Three:
    """Let go what a smaller normal force cannot hold any more."""
    longest = law[MU_S] * normal_force / law[STIFFNESS]
    length = norm(z)
    if length <= longest:
        return z
    scale = longest / length
    return z[0] * scale, z[1] * scale, z[2] * scale


@part
def flowing_share(start: float, stretch: float) -> float:
    """Share of the slip that flows above the break-away fraction: a smooth sine from 0 to 1 at full stretch."""
    if stretch >= 1.0:
        return 1.0
    return 0.5 + 0.5 * math.sin(math.pi * (stretch - 0.5 * (1.0 + start)) / (1.0 - start))


@part
def trial(
    law: Array, kappa: float, u_free: Three, A_hat: Sym3, normal_force: float, dt: float, z: Three
) -> tuple[float, Three, Three]:
    """Return (residual of the flow rule, u, z') for a given kappa; the motion is a linear solve."""
    xx, xy, xz, yy, yz, zz = A_hat
    a = kappa * (law[STIFFNESS] * dt + law[DAMPING]) + law[VISCOUS]
    b = law[STIFFNESS] * kappa + law[DAMPING] * (kappa - 1.0) / dt
    pull = multiply_of(A_hat, z)
    u = solve_of(
        (1.0 + a * xx, a * xy, a * xz, 1.0 + a * yy, a * yz, 1.0 + a * zz),
        (u_free[0] - b * pull[0], u_free[1] - b * pull[1], u_free[2] - b * pull[2]),
    )
    z_next = (kappa * (z[0] + dt * u[0]), kappa * (z[1] + dt * u[1]), kappa * (z[2] + dt * u[2]))
    length = norm(z_next)
    along = u[0] * z_next[0] + u[1] * z_next[1] + u[2] * z_next[2]
    speed = norm(u)
    dry = limit(law, speed, normal_force)[0] - law[VISCOUS] * speed
    z_ss = max(dry / law[STIFFNESS], SHORTEST)
    if along <= 0.0 or length <= law[BREAKAWAY] * z_ss:
        return 1.0 - kappa, u, z_next
    flow = dt * flowing_share(law[BREAKAWAY], length / z_ss) * along / (length * z_ss)
    return 1.0 - kappa - kappa * flow, u, z_next


@part
def bristles(
    law: Array, u_free: Three, A_hat: Sym3, normal_force: float, dt: float, state: Three
) -> tuple[Three, Three, Three]:
    """Return f_hat, u and the next state of `LuGre.solve`; kappa by regula falsi (Illinois)."""
    z = shortened(law, state, normal_force)
    r, u, z_next = trial(law, 1.0, u_free, A_hat, normal_force, dt, z)
    if r < 0.0:
        low, high, r_low, r_high, side = 0.0, 1.0, 1.0, r, 0
        for _ in range(ROOT_ITERATIONS):
            kappa = (low * r_high - high * r_low) / (r_high - r_low)
            r, u, z_next = trial(law, kappa, u_free, A_hat, normal_force, dt, z)
            if abs(r) <= ROOT_TOLERANCE or high - low <= ROOT_TOLERANCE * kappa:
                break
            if r > 0.0:
                low, r_low = kappa, r
                if side > 0:
                    r_high *= 0.5
                side = 1
            else:
                high, r_high = kappa, r
                if side < 0:
                    r_low *= 0.5
                side = -1
    k, d, c = law[STIFFNESS], law[DAMPING] / dt, law[VISCOUS]
    f_hat = (
        -(k * z_next[0] + d * (z_next[0] - z[0]) + c * u[0]),
        -(k * z_next[1] + d * (z_next[1] - z[1]) + c * u[1]),
        -(k * z_next[2] + d * (z_next[2] - z[2]) + c * u[2]),
    )
    return f_hat, u, z_next
