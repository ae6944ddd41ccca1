"""Where two solvers agree: a fixed point by Anderson's acceleration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from slip_core.arrays import Array

PASSES: Final = 60


def fixed_point(g: Callable[[Array], Array], x: Array, agreement: float) -> Array:
    """Return g at a point where |g(x) - x| is below the agreement; (n,), one unit. g is called there last.

    Anderson 1965, J. ACM 12(4):547-560, with a memory of n steps. What is nearly linear needs n + 2 calls.
    """
    points: list[Array] = []
    values: list[Array] = []
    for _ in range(PASSES):
        value = g(x)
        residual = value - x
        if np.abs(residual).max() < agreement:
            break
        points, values = [*points, x][-len(x) - 1 :], [*values, value][-len(x) - 1 :]
        if len(points) > 1:
            residuals = np.array(values) - np.array(points)
            shares = np.linalg.lstsq(np.diff(residuals, axis=0).T, residual, rcond=1e-12)[0]
            x = value - np.diff(np.array(values), axis=0).T @ shares
        else:
            x = value
    return value
