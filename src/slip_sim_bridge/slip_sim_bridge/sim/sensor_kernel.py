"""Parts of the slip sensor that run in every tick, compiled; plain forms in `slip_measure`."""

from __future__ import annotations

from numpy.random import Generator

from slip_core.arrays import Array
from slip_core.compiled import BOOL, IN1, OUT2, RNG, VOID, kernel


@kernel(VOID(RNG, OUT2))
def draw_chances(rng: Generator, out: Array) -> None:
    """Fill each row with two uniform numbers from [0, 1) and normal ones; (m, 2 + k).

    Implements: ours: `rng.random(2)` and `rng.standard_normal(k)` in turn, row by row.
    """
    for i in range(out.shape[0]):
        out[i, 0] = rng.random()
        out[i, 1] = rng.random()
        for j in range(2, out.shape[1]):
            out[i, j] = rng.standard_normal()


@kernel(BOOL(IN1, IN1))
def exceeds(values: Array, bounds: Array) -> bool:
    """Return whether any value is beyond its bound in size; (n,), (n,), one unit.

    Implements: ours: any(|values| > bounds), where NaN is not beyond.
    """
    beyond = False
    for i in range(len(values)):
        beyond |= abs(values[i]) > bounds[i]
    return beyond
