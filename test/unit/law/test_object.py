"""Rigid-body dynamics of the object against the equation of motion, momentum and free fall."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slip_vic_controller.law.contact import G_T
from slip_vic_controller.law.object import ObjectMotion, Sharing, arm_of, object_motion, sharing
from test.referees.law_referee import S, exponential, referee_law
from test.support.call import call, flat
from test.support.law_cases import Case, random_case

ROUNDING = 1e-12
MOMENTUM = 1e-7  # midpoint integration with 1 ms over 0.3 s: second order
GRAVITY = np.array([0.3, -0.2, -9.7])
INERTIA = np.array([[0.004, 0.0005, -0.0003], [0.0005, 0.006, 0.0002], [-0.0003, 0.0002, 0.005]])
MASS = 0.7


def object_case() -> Case:
    """Return a case whose pad is the object: no arm between them, so that h_o = h_ee and R_o = R_ee."""
    case = Case(7, 1)
    case.config.contact[0].rotation[:] = case.slips[0].rotation[:] = np.eye(3)
    case.gains.object.mass, case.gains.object.inertia[:], case.gains.object.gravity[:] = MASS, INERTIA, GRAVITY
    return case


def motion_of(case: Case, R_ee: np.ndarray, w_ee: np.ndarray, slip_angular: np.ndarray) -> Any:
    config, gains, _, samples, slips, _ = case.buffers
    found = call(object_motion, config, gains, samples, slips, R_ee, w_ee, slip_angular)
    return ObjectMotion(*(flat(part) for part in found))


def acceleration(R_o: np.ndarray, w_o: np.ndarray, h_o: np.ndarray) -> np.ndarray:
    """Return a_o {w} for h_o {w}."""
    case = object_case()
    case.samples[0].wrench[:] = np.kron(np.eye(2), R_o.T) @ h_o
    return np.kron(np.eye(2), R_o) @ motion_of(case, R_o, w_o, np.zeros(3)).a_o


def test_acceleration_solves_the_equation_of_motion() -> None:
    """B_o a_o + C_o v_o + g_o = -h_o, Eq. (10)."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        R_o, w_o, h_o = exponential(rng.normal(size=3)), rng.normal(size=3), rng.normal(size=6)
        a_o, J_o = acceleration(R_o, w_o, h_o), R_o @ INERTIA @ R_o.T
        np.testing.assert_allclose(MASS * a_o[:3] - MASS * GRAVITY, -h_o[:3], atol=ROUNDING)
        np.testing.assert_allclose(J_o @ a_o[3:] + S(w_o) @ J_o @ w_o, -h_o[3:], atol=ROUNDING)


def test_free_rotation_conserves_momentum() -> None:
    R, w, dt = np.eye(3), np.array([1.0, 4.0, -2.0]), 1e-3

    def quantities(R: np.ndarray, w: np.ndarray) -> np.ndarray:
        L = R @ INERTIA @ R.T @ w
        return np.array([*L, 0.5 * w @ L])

    before = quantities(R, w)
    for _ in range(300):
        w_mid = w + 0.5 * dt * acceleration(R, w, np.zeros(6))[3:]
        R_mid = exponential(0.5 * dt * w) @ R
        w = w + dt * acceleration(R_mid, w_mid, np.zeros(6))[3:]
        R = exponential(dt * w_mid) @ R
    np.testing.assert_allclose(quantities(R, w), before, atol=MOMENTUM)


def test_object_state_follows_from_the_pad() -> None:
    """Arm and turning of the object, reconstructed from the pad, equal those the pad was made from."""
    for seed in range(5):
        rng = np.random.default_rng(seed)
        case = random_case(seed, slip_axes=(1, 1, 1, 1, 1, 1))
        slip, contact, x_p = case.slips[0], case.config.contact[0], case.gains.contact_position
        R_o, w_o, v_sa = exponential(rng.normal(size=3)), *rng.normal(size=(2, 3))
        R_ee = R_o @ contact.rotation @ slip.rotation
        found = motion_of(case, R_ee, w_o + R_ee @ v_sa, v_sa)
        np.testing.assert_allclose(R_ee @ found.w_o, w_o, atol=ROUNDING)
        np.testing.assert_allclose(R_ee @ found.r, R_o @ (x_p + contact.rotation @ slip.position), atol=ROUNDING)


@pytest.mark.parametrize("contacts", [1, 3])
def test_reach_is_the_torque_on_the_farthest_contact(contacts: int) -> None:
    case = random_case(0, contacts=contacts)
    config, gains, _, _, slips, _ = case.buffers
    arms = np.array([call(arm_of, config, gains, slips, np.eye(3), k) for k in range(contacts)])
    far, rho = np.linalg.norm(arms - arms.mean(axis=0), axis=1).max(), case.config.radius
    shared = Sharing(*call(sharing, config, gains, slips))
    assert shared.reach == pytest.approx(np.hypot(far, rho) * rho, rel=ROUNDING)


def test_P_maps_contact_twist_to_coriolis_acceleration() -> None:
    """The terms with P and B_o of Eq. (29) are G^T a_o, which is what the code computes."""
    for seed in range(5):
        case = random_case(seed, contacts=2)
        case.evaluate()
        expected, R = referee_law(case.referee()), np.kron(np.eye(2), case.arm.rotation)
        found = motion_of(case, case.arm.rotation, case.arm.twist[3:], case.v_s[3:])
        np.testing.assert_allclose(
            R @ flat(call(G_T, found.r, found.a_o)), expected["follow"], atol=1e-11 * np.abs(found.a_o).max()
        )
        # a_o without gravity and wrench is what P (v_ee - v_s) stands for
        case.gains.object.gravity[:] = 0.0
        for i in range(2):
            case.samples[i].wrench[:] = 0.0
        free = motion_of(case, case.arm.rotation, case.arm.twist[3:], case.v_s[3:])
        P_v = expected["P"] @ (case.arm.twist - expected["v_s"])
        np.testing.assert_allclose(R @ flat(call(G_T, free.r, free.a_o)), -P_v, atol=1e-10)
