"""Closed loops around the law: the analytic second-order response, slip against Eq. (34), slip fed by ticks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from slip_core.params import build
from slip_vic_controller.law.attitude import Coordinates
from slip_vic_controller.law.paper import V_s
from slip_vic_controller.params.controller_params import TrajectoryParams
from slip_vic_controller.path.paths import make_path
from slip_vic_controller.robot import Robot
from test.referees.law_referee import S, V_s_dot, exponential, referee_law, slip_acceleration, two
from test.support.call import call
from test.support.law_cases import Case, put_reference, random_case, reference_of
from test.support.small_arm import HOME, JOINT_NAMES, small_arm_urdf

RESPONSE = 1e-6  # fourth-order integration with 5 ms of a loop with time constants of 0.1 s and more
DECAY = 1e-5  # relative; fourth-order integration with 5 ms leaves 2e-6, with 1 ms less than 1e-6
IDENTITY = 1e-9  # sums of products up to 1e2 in double precision
K_S = 5.0


def second_order(m: float, d: float, k: float, e: float, e_dot: float, t: float) -> float:
    """Return the solution of m e'' + d e' + k e = 0 by its two (complex) roots."""
    root = np.sqrt(complex(d * d - 4.0 * m * k))
    a, b = (-d + root) / (2.0 * m), (-d - root) / (2.0 * m)
    return float(np.real(((e_dot - b * e) * np.exp(a * t) - (e_dot - a * e) * np.exp(b * t)) / (a - b)))


def runge_kutta(rate: Any, t: float, x: np.ndarray, h: float) -> np.ndarray:
    k1 = rate(t, x)
    k2 = rate(t + h / 2, x + h / 2 * k1)
    k3 = rate(t + h / 2, x + h / 2 * k2)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(t + h, x + h * k3))


def test_loop_without_slip_is_the_analytic_response() -> None:
    """M eddot + D edot + K e = 0 in both coordinates, while the desired pose moves and turns and a wrench acts."""
    for attitude in (Coordinates.LOG, Coordinates.RPY):
        check_response(attitude)


def check_response(attitude: int) -> None:
    robot = Robot(small_arm_urdf(effort=1e4), "ee", JOINT_NAMES)
    values = {"displacement": (0.1, -0.1, 0.05), "rotation": (0.5, -0.4, 1.0), "kind": "quintic", "duration_s": 1.2}
    path = make_path(build(TrajectoryParams, values, "test"))
    case = random_case(1, attitude=attitude, slip=0.0)
    gains = case.gains.gains
    gains.K_D[:], gains.D_D[:], gains.M_D[:] = [5] * 3 + [4.5] * 3, [2.5] * 3 + [2.2] * 3, [0.4] * 3 + [0.3] * 3
    case.config.effort_limit[:] = 1e4
    case.config.nullspace_stiffness, case.config.nullspace_damping = 2.0, 1.0
    case.posture = np.array(HOME)
    q, qd = np.array(HOME), np.array([0.1, -0.1, 0.2, 0.1, -0.2, 0.1, 0.3])
    robot.terms(q, qd, case.buffers[2])
    start = (
        case.arm.position + np.array([0.03, -0.02, 0.04]),
        exponential(np.array([0.3, 0.2, -0.4])) @ case.arm.rotation,
    )

    def tick(t: float, x: np.ndarray) -> tuple[Any, np.ndarray]:
        """Return the evaluation and the joints' acceleration."""
        case.q, case.qd = x[:7].copy(), x[7:].copy()
        robot.terms(case.q, case.qd, case.buffers[2])
        put_reference(path, t, *start, case.buffers[5])
        case.samples[0].wrench[:] = np.array([1.0, -2.0, 0.5, 0.1, 0.05, -0.1]) * math.sin(7.0 * t)
        found = case.evaluate()
        assert found.ok
        assert not found.near_singular_arm
        assert not found.near_singular_attitude
        assert not found.saturated.any()
        arm = case.arm
        torque = found.effort[:7] + arm.J[:, :7].T @ found.h_ee - arm.bias[:7]
        return found, np.linalg.solve(arm.M[:7, :7], torque)

    x, h = np.concatenate((q, qd)), 0.005
    first = tick(0.0, x)[0]
    for k in range(200):
        x = runge_kutta(lambda t, x: np.concatenate((x[7:], tick(t, x)[1])), k * h, x, h)
        if k % 40 == 39:
            t = (k + 1) * h
            loops = zip(gains.M_D, gains.D_D, gains.K_D, first.e, first.e_dot, strict=True)
            np.testing.assert_allclose(tick(t, x)[0].e, [second_order(*five, t) for five in loops], atol=RESPONSE)
    assert np.abs(first.e[3:]).max() > 0.2
    assert np.linalg.norm(reference_of(path, 1.0, *start).twist[3:]) > 0.1


def grasped(stiffness: float) -> Case:
    """Return a case with the gate open as soon as anything slips, in a reference that turns."""
    case = random_case(2, slip_axes=(1, 1, 1, 1, 1, 1))
    gains, model = case.gains.gains, case.gains.object
    gains.K_D[:] = gains.D_D[:] = stiffness
    gains.M_D[:] = gains.gamma_k[:] = gains.gamma_d[:] = 1.0
    gains.alpha, gains.k_s = 1e6, K_S
    model.mass, model.gravity[:] = 0.6, [0.1, 0.0, -9.8]
    model.inertia[:] = np.diag([0.06, 0.08, 0.04]) + 4e-3 * np.eye(3)[::-1]
    case.gains.contact_position[:] = [0.05, -0.02, 0.03]
    case.config.contact[0].rotation[:] = exponential(np.array([0.2, -0.7, 1.1]))
    case.reference.rotation[:] = exponential(np.array([0.0, 0.4, 0.1]))
    case.reference.twist[:], case.reference.acceleration[:] = [0.0, 0.0, 0.0, 0.2, 0.1, -0.3], 0.0
    case.previous[:] = 0.0
    return case


def put_pad(case: Case, R_c: np.ndarray, v_c: np.ndarray, s_l: np.ndarray, R_s: np.ndarray, v_s: np.ndarray) -> None:
    """Set the pad's motion {w} and the slip of the own contact; the position error is 0.1 m on every axis."""
    case.arm.rotation[:], case.arm.twist[:] = R_c, v_c
    case.arm.position[:] = case.reference.position + 0.1
    case.slips[0].position[:], case.slips[0].rotation[:] = s_l, R_s
    case.samples[0].slip_twist[:] = two(R_c.T) @ v_s


def test_slip_decays_at_k_s_with_the_gate_open() -> None:
    """Pad and object as two free bodies, poses integrated; the wrench between them is arbitrary; |v_s| = e^(-k_s t)."""
    case = grasped(1e-12)
    x_p, o_R_p = np.array(case.gains.contact_position), np.array(case.config.contact[0].rotation)
    mass, inertia, gravity = case.gains.object.mass, case.gains.object.inertia, case.gains.object.gravity

    def unpack(y: np.ndarray):
        x_c, R_c, v_c = y[:3], y[3:12].reshape(3, 3), y[12:18]
        x_o, R_o, v_o = y[18:21], y[21:30].reshape(3, 3), y[30:36]
        R_p, r = R_o @ o_R_p, x_c - x_o
        s = R_p.T @ (x_c - x_o - R_o @ x_p), R_p.T @ R_c
        return R_c, v_c, R_o, v_o, r, s, v_c - np.concatenate((v_o[:3] + np.cross(v_o[3:], r), v_o[3:]))

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        R_c, v_c, R_o, v_o, r, s, v_s = unpack(y)
        h_pad = np.array([2.0 * math.sin(9 * t), 1.0, -6.0, 0.02, 0.01 * math.cos(5 * t), 0.01])
        put_pad(case, R_c, v_c, *s, v_s)
        case.samples[0].wrench[:] = h_pad
        a_c = np.array(case.evaluate().a_C)
        f, tau = -R_c @ h_pad[:3], -R_c @ h_pad[3:]
        J, w = R_o @ inertia @ R_o.T, v_o[3:]
        turning = np.linalg.solve(J, tau + np.cross(r, f) - np.cross(w, J @ w))
        a_o = np.concatenate((f / mass + gravity, turning))
        return np.concatenate((v_c[:3], (S(v_c[3:]) @ R_c).ravel(), a_c, v_o[:3], (S(w) @ R_o).ravel(), a_o))

    R_c, v_c = exponential(np.array([0.3, 0.1, -0.2])), np.array([0.4, -0.3, 0.2, 0.5, -0.6, 0.4])
    R_o, x_o = exponential(np.array([-0.4, 0.2, 0.3])), np.array([0.2, 0.1, 0.0])
    x_c = x_o + R_o @ (x_p + o_R_p @ np.array([0.01, -0.02, 0.0]))
    v_o = np.array([0.0, 0.2, -0.1, 0.7, 0.3, -0.9])
    y = np.concatenate((x_c, R_c.ravel(), v_c, x_o, R_o.ravel(), v_o))
    start, h, steps = np.linalg.norm(unpack(y)[-1]), 5e-3, 100
    for k in range(steps):
        y = runge_kutta(rate, k * h, y, h)
    assert start > 1.0
    assert np.linalg.norm(unpack(y)[-1]) == pytest.approx(start * math.exp(-K_S * h * steps), rel=DECAY)


def test_slip_energy_changes_as_in_eq_34() -> None:
    """With the gate open and the impedance at work, v_s' vdot_s is V_s_dot with Z and the feed-forward.

    a_d stands outside of the gate, so Eq. (34) carries v_s . a_d, which is not in the printed one.
    """
    for seed in range(4):
        rng, case = np.random.default_rng(seed), grasped(3.0)
        R_s, R_c = exponential(rng.normal(size=3)), exponential(rng.normal(size=3))
        v_c, v_s, h_pad, a_d = rng.normal(size=(4, 6))
        put_pad(case, R_c, v_c, rng.normal(scale=0.02, size=3), R_s, v_s)
        case.samples[0].wrench[:], case.reference.acceleration[:] = h_pad, a_d
        law, known = case.evaluate(), referee_law(case.referee())
        assert law.gate == 1.0
        a_s = slip_acceleration(law.a_C, known["follow"], known["w_o"], v_s, known["Phi2"])
        expected = V_s_dot(K_S, v_s, law.Z + a_d)
        assert v_s @ a_s == pytest.approx(expected, abs=IDENTITY)
        assert expected != pytest.approx(V_s_dot(K_S, v_s, law.Z), abs=0.01)
        assert expected != pytest.approx(-2 * K_S * call(V_s, v_s), abs=0.1)


def test_own_acceleration_comes_back_through_an_open_gate_unless_masked() -> None:
    """Why slip_axes exists: in stick h_ee carries the pad's own acceleration, and an open gate feeds it back 1 to 1."""
    a_now, found = np.array([0.0, 0.0, 0.7, 0.2, 0.0, 0.0]), {}
    for axes in ((1, 1, 1, 1, 1, 1), (1, 1, 0, 0, 0, 1)):
        case = grasped(1e-12)
        model = case.gains.object
        case.config.contact[0].slip_axes[:] = axes
        case.gains.contact_position[:], case.config.contact[0].rotation[:] = 0.0, np.eye(3)
        case.reference.rotation[:], case.reference.twist[:] = np.eye(3), 0.0
        v_s = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
        put_pad(case, np.eye(3), v_s, np.zeros(3), np.eye(3), v_s)
        pull = model.mass * (model.gravity - a_now[:3])
        case.samples[0].wrench[:] = np.concatenate((pull, -model.inertia @ a_now[3:]))
        law = case.evaluate()
        np.testing.assert_allclose(law.follow, a_now, atol=IDENTITY)
        found[axes] = law.a_C[2:4].copy()
    np.testing.assert_allclose(found[(1, 1, 1, 1, 1, 1)], a_now[2:4], atol=IDENTITY)
    np.testing.assert_allclose(found[(1, 1, 0, 0, 0, 1)], 0.0, atol=IDENTITY)
