"""Small matrices without a linear algebra library: against numpy's and scipy's."""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_discrete_are

from slip_core.arrays import product, riccati, solve
from test.support.call import call

ROUNDING = 1e-12


def test_products_and_solutions_are_those_of_numpy() -> None:
    dice = np.random.default_rng(1)
    for n in (1, 2, 3, 6):
        A, B, C = dice.normal(size=(n, 4)), dice.normal(size=(4, n)), dice.normal(size=(n, 2))
        np.testing.assert_allclose(product(A, B, C), A @ B @ C, rtol=ROUNDING, atol=ROUNDING)
        np.testing.assert_allclose(product(A, B[:, 0]), A @ B[:, 0], rtol=ROUNDING, atol=ROUNDING)
        square = dice.normal(size=(n, n))
        square[0, 0] *= n == 1  # rows must be exchanged
        np.testing.assert_allclose(call(solve, square, C), np.linalg.solve(square, C), rtol=1e3 * ROUNDING)


def test_riccati_is_the_stabilising_solution() -> None:
    """It is what its equation says, scipy's as far as that is exact, and the filter forgets how it began."""
    dice = np.random.default_rng(2)
    for n, m in ((1, 1), (2, 1), (3, 1), (3, 2)):
        for _ in range(50):
            F, H = np.eye(n) + np.triu(dice.uniform(0.0, 0.3, (n, n)), 1), np.eye(n)[:m]
            Q, R = np.diag(10.0 ** dice.uniform(-3, 3, n)), np.diag(10.0 ** dice.uniform(-3, 3, m))
            if m == 1:
                F = F + np.triu(np.full((n, n), 0.1), 1)  # so that it is observable
            P = call(riccati, F, H, Q, R)
            gain = np.linalg.solve(H @ P @ H.T + R, H @ P).T
            again = F @ (P - gain @ H @ P) @ F.T + Q
            size = np.sqrt(np.outer(np.diag(P), np.diag(P)))
            assert np.abs((again - P) / size).max() < 1e-11
            assert np.abs((solve_discrete_are(F.T, H.T, Q, R) - P) / size).max() < 1e-8
            assert np.abs(np.linalg.eigvals(F @ (np.eye(n) - gain @ H))).max() < 1.0
