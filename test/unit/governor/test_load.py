"""The load of a pad acceleration: against matrices in plain numpy, and its properties."""

import numpy as np
from scipy.spatial.transform import Rotation

from slip_core.records import POSE, new, record
from slip_core.vectors import mat, spatial, vec
from slip_vic_controller.governor.guard import guard_factor
from slip_vic_controller.governor.load import ALONE, Held, at_contact, load, size
from slip_vic_controller.law.contact import Contact, contact_arm, pad_rotation
from slip_vic_controller.law.object import Sharing
from test.referees.arrays import skew
from test.support.call import blank

SEED, CASES = 5, 60
ROUNDING = 1e-12
"""Relative: a few hundred operations."""


def referee(m, J_o, R_o, R, r, w, a, gravity, axes, rho):
    """S^-1 Sigma R^T h, h = -G^-1 (B a_o + C v_o + g), with matrices {w}."""
    G = np.eye(6)
    G[3:, :3] = skew(r)
    J = R_o @ J_o @ R_o.T
    B, C = np.zeros((6, 6)), np.zeros((6, 6))
    B[:3, :3], B[3:, 3:], C[3:, 3:] = m * np.eye(3), J, skew(w) @ J
    Phi2 = np.concatenate((np.cross(w, np.cross(w, r)), np.zeros(3)))
    a_o = np.linalg.solve(G.T, a - Phi2)
    v_o = np.concatenate((np.zeros(3), w))
    h = -np.linalg.solve(G, B @ a_o + C @ v_o + np.concatenate((-m * gravity, np.zeros(3))))
    turned = np.concatenate((R.T @ h[:3], R.T @ h[3:]))
    return np.array([1, 1, 1, 1 / rho, 1 / rho, 1 / rho]) * axes * turned


def test_load_is_rigid_body_wrench() -> None:
    rng = np.random.default_rng(SEED)
    for _ in range(CASES):
        R_o, R_c, R_s = Rotation.random(3, rng).as_matrix()
        position, slip = rng.normal(size=(2, 3)) * 0.03
        A = rng.normal(size=(3, 3))
        J = 1e-3 * (A @ A.T + np.eye(3))
        m, rho, axes = rng.uniform(0.1, 2), rng.uniform(0.01, 0.1), rng.integers(0, 2, 6).astype(float)
        w, gravity, a = rng.normal(size=3), rng.normal(size=3) * 9, rng.normal(size=6)
        R = R_o @ R_c @ R_s
        r = R_o @ (position + R_c @ slip)
        contact, pad = blank(Contact), record(new(POSE), POSE)
        contact.rotation[:], pad.position[:], pad.rotation[:] = R_c, slip, R_s
        turned = pad_rotation(contact, pad)
        inertia, arm = turned.T() @ (mat(J) @ turned), contact_arm(turned, vec(position), contact, pad)
        held = Held(m, inertia, arm, spatial(axes / np.repeat((1.0, rho), 3)), vec(gravity), ALONE)
        ours = load(held, mat(R), vec(w), spatial(a))
        theirs = referee(m, J, R_o, R, r, w, a, gravity, axes, rho)
        np.testing.assert_allclose(np.concatenate(ours), theirs, rtol=0, atol=ROUNDING * np.abs(theirs).max() + 1e-15)
        assert abs(size(ours) - np.linalg.norm(theirs)) <= ROUNDING * np.linalg.norm(theirs)


def test_guard_takes_largest_factor() -> None:
    rng = np.random.default_rng(SEED)
    shares = np.linspace(0, 1, 2001)
    kinds = set()
    for _ in range(500):
        drawn, rest = rng.normal(size=(2, 6)) * rng.uniform(0.1, 2, (2, 1))
        F = rng.uniform(0.3, 3)
        k = guard_factor(spatial(drawn), spatial(rest), F)
        sizes = np.linalg.norm(np.outer(shares, drawn) + rest, axis=1)
        assert 0.0 <= k <= 1.0
        if sizes.min() < F:
            assert np.linalg.norm(k * drawn + rest) <= F * (1 + 1e-12)
            assert k >= shares[sizes <= F].max() - 1e-9
            kinds.add("whole" if k == 1.0 else "part")
        elif sizes.min() > F * 1.001:
            assert np.linalg.norm(k * drawn + rest) <= sizes.min() * (1 + 1e-6)
            kinds.add("too heavy")
    assert kinds == {"whole", "part", "too heavy"}


def test_shared_load_bounds_every_pad() -> None:
    rng, rho = np.random.default_rng(SEED), 0.015
    weights = spatial(np.array([1.0, 1, 0, 0, 0, 1 / rho]))
    tight = 0.0
    for _ in range(300):
        places = np.hstack((rng.normal(size=(2, 2)), np.zeros((2, 1)))) * 0.2
        middle = places.mean(axis=0)
        d = places - middle
        A = 2 * rho**2 * np.eye(3) + sum(x @ x * np.eye(3) - np.outer(x, x) for x in d)
        arm = float(np.hypot(np.linalg.norm(d[0]), rho))
        shared = Sharing(2, vec(middle), vec(np.zeros(3)), mat(np.linalg.inv(A)), arm * rho)
        held = Held(1.0, mat(np.eye(3)), vec(places[0]), weights, vec(np.zeros(3)), shared)
        force, torque = rng.normal(size=3), 0.1 * rng.normal(size=3)
        bound = size(at_contact(held, vec(force), vec(torque)))
        y = np.linalg.solve(A, torque - np.cross(middle, force))
        loads = [np.hypot(np.linalg.norm((force / 2 + np.cross(y, x))[:2]), rho * y[2]) for x in d]
        assert max(loads) <= bound * (1.0 + ROUNDING)
        tight = max(tight, max(loads) / bound)
    assert tight > 0.9
