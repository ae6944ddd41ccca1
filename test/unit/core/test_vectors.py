"""Vectors and records: what Python runs and what the compiler compiles give the same bits."""

import os
import subprocess
import sys
from typing import Annotated

import numpy as np
import pytest

from slip_core.compiled import IN1, OUT1, VOID, kernel, part
from slip_core.records import Mat3, Real, Record, Records, Vec3, Vec6, Whole, dtype_of, new, record
from slip_core.vectors import (
    IDENTITY,
    Sym,
    Vec,
    largest_eigenvalue,
    mat,
    put,
    put_mat,
    put_spatial,
    spatial,
    vec,
    with_diagonal,
)

SEED = 3


class Contact(Record):
    position: Vec3
    rotation: Mat3
    axes: Vec6
    count: Whole


class Grasp(Record):
    k_s: Real
    K_D: Vec6
    contacts: Annotated[Records[Contact], 3]
    flag: Whole


GRASP = dtype_of(Grasp)


@part
def turned(contact, k):
    a = vec(contact.position) + k * Vec(1.0, 2.0, 3.0)
    return (mat(contact.rotation) @ mat(contact.rotation).T()) @ a


@kernel(VOID, IN1, OUT1)
def every_operator(inputs, outputs):
    given, out = record(inputs, GRASP), record(outputs, GRASP)
    a = Vec(1.0, 2.0, 3.0)
    total = a - 2.0 * a
    for i in range(3):
        contact = given.contacts[i]
        total = total + given.K_D[i] * turned(contact, given.k_s)
        s = spatial(contact.axes)
        s = 2.0 * (mat(contact.rotation) @ (s + s)) - s * s / (s + s)
        put_spatial(out.contacts[i].axes, -s)
        put(out.contacts[i].position, total.cross(a) * a)
        put_mat(out.contacts[i].rotation, mat(contact.rotation) @ IDENTITY)
        out.contacts[i].count += i
        out.K_D[i] = s.dot(s)
    out.K_D[3:] = given.K_D[3:]
    out.flag = given.contacts[1].count
    out.k_s = total.norm()


def random_grasp() -> np.ndarray:
    buffer, rng = new(GRASP), np.random.default_rng(SEED)
    grasp = record(buffer, GRASP)
    grasp.k_s, grasp.K_D[:] = 3.0, rng.normal(size=6)
    for contact in grasp.contacts:
        contact.position[:], contact.rotation[:] = rng.normal(size=3), rng.normal(size=(3, 3))
        contact.axes[:], contact.count = rng.normal(size=6), 7
    return buffer


def result_bits() -> str:
    out = new(GRASP)
    every_operator(random_grasp(), out)
    return out.tobytes().hex()


def test_interpreted_and_compiled_give_equal_bits() -> None:
    code = f"import runpy; print(runpy.run_path({__file__!r})['result_bits']())"
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    interpreted = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert interpreted.stdout.strip() == result_bits(), interpreted.stderr


def test_operators_are_those_of_numpy() -> None:
    rng = np.random.default_rng(SEED)
    for _ in range(100):
        a, b, A, B = rng.normal(size=3), rng.normal(size=3), rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
        u, v, M, N = Vec(*a), Vec(*b), mat(A), mat(B)
        k = rng.normal()
        for ours, theirs in (
            (u + v, a + b), (u - v, a - b), (-u, -a), (k * u, k * a), (u.cross(v), np.cross(a, b)),
            (M @ u, A @ a), (M.T() @ u, A.T @ a), (M @ N, A @ B),
            (u * v, a * b), (u / v, a / b),
        ):  # fmt: skip
            np.testing.assert_allclose(np.array(ours), theirs, rtol=1e-15, atol=1e-14)
        np.testing.assert_allclose((u.dot(v), u.norm()), (a @ b, np.linalg.norm(a)), rtol=1e-15, atol=1e-14)


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
