"""The internal wrench of several contacts, from the true geometry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slip_core.arrays import Array


def internal_wrenches(
    wrenches: Sequence[Array], places: Sequence[Array], attitudes: Sequence[Array], centre: Array, radius: float
) -> tuple[Array, list[Array]]:
    """Return what all contacts do to the object about its centre of mass {w}, and the internal part of each contact's
    wrench, on its pad's axes; (6,) each [N, N m].

    h_int,i = h_i - W G_i^T (sum_j G_j W G_j^T)^-1 sum_j G_j h_j with W = diag(1, 1, 1, rho^2, rho^2, rho^2),
    from the true geometry.

    Args:
        wrenches: of the object on each pad; (6,) pad axes.
        places, attitudes: of the pads; (3,) [m], (3, 3) {w}.
        centre: of the object's mass (3,) [m] {w}.
        radius: rho [m].
    """
    W, turn, G = np.diag([1.0] * 3 + [radius * radius] * 3), [], []
    for x, R in zip(places, attitudes, strict=True):
        r = x - centre
        S = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
        G.append(np.block([[np.eye(3), np.zeros((3, 3))], [S, np.eye(3)]]))
        turn.append(np.kron(np.eye(2), R))
    world = [T @ h for T, h in zip(turn, wrenches, strict=True)]
    total = np.sum([g @ h for g, h in zip(G, world, strict=True)], axis=0)
    y = np.linalg.solve(sum(g @ W @ g.T for g in G), total)
    return total, [T.T @ (h - W @ g.T @ y) for T, h, g in zip(turn, world, G, strict=True)]
