"""The internal wrench of several contacts, from the true geometry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from slip_core.arrays import Array


def internal_wrenches(
    wrenches: Sequence[Array], places: Sequence[Array], attitudes: Sequence[Array], centre: Array, radius: float
) -> list[Array]:
    """Return the internal part of each contact's wrench, on its pad's axes; (6,) each [N, N m].

    h_int,i = h_i - W G_i^T (sum_j G_j W G_j^T)^-1 sum_j G_j h_j with W = diag(1, 1, 1, rho^2, rho^2, rho^2),
    from the true geometry.

    Args:
        wrenches: of the object on each pad; (6,) pad axes.
        places, attitudes: of the pads; (3,) [m], (3, 3) {w}.
        centre: of the object's mass (3,) [m] {w}.
        radius: rho [m].
    """
    n, r, R = len(places), np.array(places) - centre, np.array(attitudes)
    W = np.array([1.0] * 3 + [radius * radius] * 3)
    G = np.tile(np.eye(6), (n, 1, 1))
    G[:, 3:, :3] = np.cross(r[:, np.newaxis], np.eye(3)).transpose(0, 2, 1)
    world = (np.array(wrenches).reshape(n, 2, 3) @ R.transpose(0, 2, 1)).reshape(n, 6)
    total = np.einsum("kij,kj->i", G, world)
    y = np.linalg.solve(np.einsum("kij,j,klj->il", G, W, G), total)
    internal = world - W * np.einsum("kji,j->ki", G, y)
    return list((internal.reshape(n, 2, 3) @ R).reshape(n, 6))
