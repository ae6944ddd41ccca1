"""Orientation error: kinematics with a moving desired attitude by finite differences, fallbacks near singularities."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from slip_vic_controller.law import attitude
from slip_vic_controller.law.attitude import LOG_BRANCH_LIMIT, RPY_DAMPED_BELOW, Coordinates
from test.referees.law_referee import about, exponential, jacobian_series, logarithm
from test.support.call import call, flat

FIRST_DIFFERENCE = 1e-7  # central differences with step 1e-5 of functions of order one
SECOND_DIFFERENCE = 2e-6  # the same on a rate with second derivatives up to 100
ROUNDING = 1e-12
ZERO = np.zeros(3)
Motion = Callable[[float], tuple[np.ndarray, np.ndarray, np.ndarray]]


def attitude_error(coordinates: int, R_ee, R_d, w_ee, w_d, alpha_d, previous) -> Any:
    """Return the error with T_e and its inverse as matrices."""
    error = call(attitude.attitude_error, coordinates, R_ee, R_d, w_ee, w_d, alpha_d, previous)
    units = np.eye(6)[3:]
    forward = np.array([flat(call(attitude.T_e, error, unit))[3:] for unit in units]).T
    back = np.array([flat(call(attitude.T_e_inverse, coordinates, error.error, R_d, unit))[3:] for unit in units]).T
    return SimpleNamespace(
        error=flat(error.error), rate=flat(error.rate), Theta=flat(error.Theta), T_e=forward, T_e_inverse=back,
        near_singular=error.near_singular,
    )  # fmt: skip


def roll_pitch_yaw(R: np.ndarray) -> np.ndarray:
    return flat(call(attitude.roll_pitch_yaw, R))


def motion(rng: np.random.Generator) -> Motion:
    """Return a smooth attitude over time with its angular velocity and acceleration, exact by the power series."""
    a, b, c = rng.normal(scale=0.5, size=(3, 3))
    start = exponential(rng.normal(size=3))

    def at(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        phi, phi_dot, phi_ddot = a + b * t + c * t * t, b + 2.0 * c * t, 2.0 * c
        J, J_dot = jacobian_series(phi, phi_dot)
        return exponential(phi) @ start, J @ phi_dot, J @ phi_ddot + J_dot @ phi_dot

    return at


def close_to(desired: Motion, rng: np.random.Generator) -> Motion:
    """Return a motion that stays within about 1.5 rad of `desired` at t = 0."""
    other, offset = motion(rng), exponential(rng.normal(scale=0.5, size=3)) @ desired(0.0)[0]
    start = other(0.0)[0]
    return lambda t: (other(t)[0] @ start.T @ offset, *other(t)[1:])


def error_at(kind: int, actual: Motion, desired: Motion, t: float) -> Any:
    (R, w, _), (R_d, w_d, alpha_d) = actual(t), desired(t)
    return attitude_error(kind, R, R_d, w, w_d, alpha_d, ZERO)


@pytest.mark.parametrize("kind", [Coordinates.LOG, Coordinates.RPY])
@pytest.mark.parametrize("seed", range(5))
def test_kinematics_with_a_moving_desired_attitude(kind: int, seed: int) -> None:
    """edot_o is the derivative of e_o, and alpha_ee = alpha_d + T_e eddot_o + Theta."""
    rng, h = np.random.default_rng(seed), 1e-5
    desired = motion(rng)
    actual = close_to(desired, rng)
    now, before, after = (error_at(kind, actual, desired, t) for t in (0.0, -h, h))
    assert not now.near_singular
    np.testing.assert_allclose(now.rate, (after.error - before.error) / (2 * h), atol=FIRST_DIFFERENCE)
    second = (after.rate - before.rate) / (2 * h)
    alpha, alpha_d = actual(0.0)[2], desired(0.0)[2]
    np.testing.assert_allclose(alpha, alpha_d + now.T_e @ second + now.Theta, atol=SECOND_DIFFERENCE)
    np.testing.assert_allclose(now.T_e @ now.T_e_inverse, np.eye(3), atol=ROUNDING)


@pytest.mark.parametrize("axis", [0, 2])
@pytest.mark.parametrize("angle", [-1.2, 0.4, 1.4])
def test_both_coordinates_are_identical_about_one_axis(axis: int, angle: float) -> None:
    w, w_d, alpha_d = (v * np.eye(3)[axis] for v in (0.7, -0.4, 0.3))
    R, R_d = about(axis, angle + 0.2), about(axis, 0.2)
    log, rpy = (attitude_error(kind, R, R_d, w, w_d, alpha_d, ZERO) for kind in (Coordinates.LOG, Coordinates.RPY))
    for name in ("error", "rate", "Theta"):
        np.testing.assert_allclose(getattr(log, name), getattr(rpy, name), atol=ROUNDING)
    np.testing.assert_allclose(log.error, angle * np.eye(3)[axis], atol=ROUNDING)
    np.testing.assert_allclose(log.rate, w - w_d, atol=ROUNDING)


def test_the_papers_convention_is_consistent_but_for_two_signs() -> None:
    """From current to desired e' = -e_o, w_d - w_ee = T_e e'_dot: then Eq. (23) has -Tdot_e as printed, but +K e'.

    alpha_ee = a_d - T_e e'_ddot - Tdot_e e'_dot with e'_ddot = M^-1 (-K e' - D e'_dot) is our a_C to the last digits.
    """
    for seed in range(5):
        rng = np.random.default_rng(seed)
        R, w, K, D, M = exponential(rng.normal(scale=0.5, size=3)), rng.normal(size=3), *rng.uniform(0.5, 3.0, (3, 3))
        now = attitude_error(Coordinates.LOG, R, np.eye(3), w, ZERO, ZERO, ZERO)
        ours = now.T_e @ ((-K * now.error - D * now.rate) / M) + now.Theta
        e = logarithm(R.T)
        T_e = jacobian_series(-e, ZERO)[0]
        e_dot = np.linalg.inv(T_e) @ -w
        printed = T_e @ ((K * e + D * e_dot) / M) - jacobian_series(-e, -e_dot)[1] @ e_dot
        np.testing.assert_allclose(ours, printed, atol=ROUNDING)


def test_logarithm_keeps_its_branch() -> None:
    """Turning past 180 deg the error goes on growing up to 270 deg, stays bounded there, and says so."""
    previous, seen = ZERO, []
    for angle in np.arange(0.0, 2.0 * np.pi, 0.03):
        error = attitude_error(Coordinates.LOG, about(1, angle), np.eye(3), ZERO, ZERO, ZERO, previous)
        previous = np.array(error.error)
        seen.append(error.error[1])
        assert np.abs(error.T_e_inverse).max() < 4.0
        assert error.near_singular == (abs(error.error[1]) > np.pi - 0.2)
    (jump,) = np.flatnonzero(np.abs(np.diff(seen)) > 0.1)
    assert seen[jump] == pytest.approx(LOG_BRANCH_LIMIT, abs=0.031)
    assert max(seen) <= LOG_BRANCH_LIMIT


def test_rpy_near_gimbal_lock_is_bounded() -> None:
    for pitch in (np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-9, np.pi / 2 - 1e-3, np.pi / 2 - 0.05):
        R = about(2, 0.3) @ about(1, pitch) @ about(0, -0.2)
        error = attitude_error(Coordinates.RPY, R, np.eye(3), np.array([1.0, -2.0, 0.5]), ZERO, ZERO, ZERO)
        assert error.near_singular
        for name in ("error", "rate", "Theta", "T_e", "T_e_inverse"):
            assert np.isfinite(getattr(error, name)).all()
        assert np.abs(error.T_e_inverse).max() < 2.0 / RPY_DAMPED_BELOW


def test_rpy_damping_sets_in_continuously() -> None:
    """The damped inverse meets the exact one at the border, on both sides."""
    pitch = np.arccos(RPY_DAMPED_BELOW)
    w = np.array([1.0, 1.0, 1.0])
    inside, outside = (
        attitude_error(Coordinates.RPY, about(1, pitch + d), np.eye(3), w, ZERO, ZERO, ZERO) for d in (1e-7, -1e-7)
    )
    assert inside.near_singular
    assert not outside.near_singular
    np.testing.assert_allclose(inside.rate, outside.rate, atol=1e-3)


def test_rpy_angles_rebuild_the_matrix() -> None:
    for seed in range(5):
        R = exponential(np.random.default_rng(seed).normal(size=3))
        roll, pitch, yaw = roll_pitch_yaw(R)
        np.testing.assert_allclose(about(2, yaw) @ about(1, pitch) @ about(0, roll), R, atol=ROUNDING)
