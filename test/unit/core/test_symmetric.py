"""Closed forms of symmetric matrices of order 3 against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.compiled import part
from slip_core.symmetric import Sym, largest_eigenvalue, with_diagonal
from slip_core.vectors import Vec


@part
def both(A, b):
    return A @ b, A.solve(b), 2.0 * A


def test_product_solution_and_largest_eigenvalue():
    rng = np.random.default_rng(0)
    for _ in range(1000):
        B = rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-2, 2, size=3)[:, None]
        A = B @ B.T + 1e-3 * np.eye(3)
        b = rng.normal(size=3)
        sym, right = Sym(*A[np.triu_indices(3)].tolist()), Vec(*b.tolist())
        largest = np.linalg.eigvalsh(A)[-1]
        assert largest_eigenvalue(sym) == pytest.approx(largest, rel=1e-12)
        product, solution, twice = both(sym, right)
        assert (product, solution, twice) == (sym @ right, sym.solve(right), 2.0 * sym)
        np.testing.assert_allclose(product, A @ b, rtol=1e-12, atol=1e-12 * largest)
        assert np.abs(A @ np.array(solution) - b).max() <= 100 * np.finfo(float).eps * np.linalg.cond(A)
        np.testing.assert_allclose(with_diagonal(0.5, sym), (A + 0.5 * np.eye(3))[np.triu_indices(3)], rtol=1e-15)
    assert largest_eigenvalue(Sym(2.0, 0.0, 0.0, 2.0, 0.0, 2.0)) == 2.0
