"""Closed loops: impedance against the analytic second-order response, slip against Eq. (34), slip fed by ticks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_core.params import build
from slip_core.types import JointSample, SlipSample, WrenchSample
from slip_vic_controller.core import grasp
from slip_vic_controller.core.attitude import log_error
from slip_vic_controller.core.controller import VicController
from slip_vic_controller.core.grasp import Contact, SlipDisplacement
from slip_vic_controller.core.impedance import Gains
from slip_vic_controller.core.law import control_law, grasp_terms
from slip_vic_controller.core.lyapunov import V_s, V_s_dot
from slip_vic_controller.core.object_dynamics import ObjectModel, slip_acceleration
from slip_vic_controller.params import ControllerParams

from .law_referee import S, exponential
from .small_arm import HOME, small_arm_urdf

RESPONSE = 1e-6  # fourth-order integration with 5 ms of a loop with time constants of 0.1 s and more
DECAY = 1e-5  # relative; fourth-order integration with 5 ms leaves 2e-6, with 1 ms less than 1e-6
IDENTITY = 1e-9  # sums of products up to 1e2 in double precision


def second_order(m: float, d: float, k: float, e: float, e_dot: float, t: float) -> float:
    """Return the solution of m e'' + d e' + k e = 0 by its two (complex) roots."""
    root = np.sqrt(complex(d * d - 4.0 * m * k))
    a, b = (-d + root) / (2.0 * m), (-d - root) / (2.0 * m)
    return float(np.real(((e_dot - b * e) * np.exp(a * t) - (e_dot - a * e) * np.exp(b * t)) / (a - b)))


@pytest.mark.parametrize("kind", ["classical", "vic"])
@pytest.mark.parametrize("attitude", ["log", "rpy"])
def test_loop_without_slip_is_the_analytic_response(attitude: str, kind: str) -> None:
    """M eddot + D edot + K e = 0 in every coordinate, while the desired pose moves and turns and a wrench acts."""
    values = {
        "controller": kind,
        "attitude": attitude,
        "trajectory": {
            "kind": "quintic",
            "duration_s": 1.2,
            "displacement": (0.1, -0.1, 0.05),
            "rotation": (0.5, -0.4, 1.0),
        },
        "nullspace": {"stiffness": 2.0, "damping": 1.0},
    }
    controller = VicController(build(ControllerParams, values, "test"), small_arm_urdf(effort=1e4))
    q, qd = np.array(HOME), np.array([0.1, -0.1, 0.2, 0.1, -0.2, 0.1, 0.3])
    start = controller.initial_state(JointSample(0, q, qd, np.zeros(7)))
    start = start._replace(
        start_position=start.start_position + np.array([0.03, -0.02, 0.04]),
        start_rotation=exponential(np.array([0.3, 0.2, -0.4])) @ start.start_rotation,
    )
    no_slip = (SlipSample(0, np.zeros(6)),)

    def tick(t: float, q: np.ndarray, qd: np.ndarray):
        h = np.array([1.0, -2.0, 0.5, 0.1, 0.05, -0.1]) * math.sin(7.0 * t)
        result = controller.step(start, JointSample(round(t * 1e9), q, qd, np.zeros(7)), (WrenchSample(0, h),), no_slip)
        terms = result.diagnostics.terms
        assert terms is not None
        assert not result.diagnostics.near_singular
        assert not result.diagnostics.saturated.any()
        torque = result.command.effort + terms.arm.J.T @ terms.h_ee - terms.arm.bias
        return terms, np.linalg.solve(terms.arm.M, torque)

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate((x[7:], tick(t, x[:7], x[7:])[1]))

    first = tick(0.0, q, qd)[0].law
    x, h = np.concatenate((q, qd)), 0.005
    for k in range(200):
        t = k * h
        k1 = rate(t, x)
        k2 = rate(t + h / 2, x + h / 2 * k1)
        k3 = rate(t + h / 2, x + h / 2 * k2)
        k4 = rate(t + h, x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        if k % 40 == 39:
            law = tick(t + h, x[:7], x[7:])[0].law
            gains = controller.gains
            expected = [
                second_order(*five, t + h)
                for five in zip(gains.M_D, gains.D_D, gains.K_D, first.e, first.e_dot, strict=True)
            ]
            np.testing.assert_allclose(law.e, expected, atol=RESPONSE)
    assert np.abs(first.e[3:]).max() > 0.2
    assert np.linalg.norm(tick(1.0, x[:7], x[7:])[0].reference.twist[3:]) > 0.1


MODEL = ObjectModel(0.6, np.diag([0.06, 0.08, 0.04]) + 4e-3 * np.eye(3)[::-1], np.array([0.1, 0.0, -9.8]))
CONTACT = Contact(np.array([0.05, -0.02, 0.03]), exponential(np.array([0.2, -0.7, 1.1])), np.ones(6))
K_S = 5.0


def gains(stiffness: float, alpha: float) -> Gains:
    return Gains(np.full(6, stiffness), np.full(6, stiffness), np.ones(6), np.ones(6), np.ones(6), alpha, K_S)


def evaluate(gain: Gains, R_c, v_c, s: SlipDisplacement, v_s, h_pad, a_d):
    terms = grasp_terms(MODEL, [CONTACT], [s], [h_pad], R_c, v_c, v_s)
    R_d = exponential(np.array([0.0, 0.4, 0.1]))
    attitude = log_error(R_c, R_d, v_c[3:], np.array([0.2, 0.1, -0.3]), a_d[3:], np.zeros(3))
    law = control_law(gain, CONTACT.slip_axes, attitude, np.full(3, 0.1), v_c[:3], a_d, R_c, v_s, terms)
    return terms, law


def test_slip_decays_at_k_s_with_the_gate_open() -> None:
    """Pad and object as two free bodies, poses integrated; the wrench between them is arbitrary; |v_s| = e^(-k_s t)."""
    gain = gains(1e-12, 1e6)

    def unpack(y: np.ndarray):
        x_c, R_c, v_c = y[:3], y[3:12].reshape(3, 3), y[12:18]
        x_o, R_o, v_o = y[18:21], y[21:30].reshape(3, 3), y[30:36]
        R_p = R_o @ CONTACT.rotation
        s = SlipDisplacement(R_p.T @ (x_c - x_o - R_o @ CONTACT.position), R_p.T @ R_c)
        r = x_c - x_o
        v_s = v_c - np.concatenate((v_o[:3] + np.cross(v_o[3:], r), v_o[3:]))
        return R_c, v_c, R_o, v_o, r, s, v_s

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        R_c, v_c, R_o, v_o, r, s, v_s = unpack(y)
        h_pad = np.array([2.0 * math.sin(9 * t), 1.0, -6.0, 0.02, 0.01 * math.cos(5 * t), 0.01])
        a_c = evaluate(gain, R_c, v_c, s, v_s, h_pad, np.zeros(6))[1].a_C
        f, tau = -R_c @ h_pad[:3], -R_c @ h_pad[3:]
        J, w = R_o @ MODEL.inertia @ R_o.T, v_o[3:]
        a_o = np.concatenate(
            (f / MODEL.mass + MODEL.gravity, np.linalg.solve(J, tau + np.cross(r, f) - np.cross(w, J @ w)))
        )
        return np.concatenate((v_c[:3], (S(v_c[3:]) @ R_c).ravel(), a_c, v_o[:3], (S(w) @ R_o).ravel(), a_o))

    R_c, v_c = exponential(np.array([0.3, 0.1, -0.2])), np.array([0.4, -0.3, 0.2, 0.5, -0.6, 0.4])
    R_o, x_o = exponential(np.array([-0.4, 0.2, 0.3])), np.array([0.2, 0.1, 0.0])
    x_c = x_o + R_o @ (CONTACT.position + CONTACT.rotation @ np.array([0.01, -0.02, 0.0]))
    v_o = np.array([0.0, 0.2, -0.1, 0.7, 0.3, -0.9])
    y = np.concatenate((x_c, R_c.ravel(), v_c, x_o, R_o.ravel(), v_o))
    start, h, steps = np.linalg.norm(unpack(y)[-1]), 5e-3, 100
    for k in range(steps):
        t = k * h
        k1 = rate(t, y)
        k2 = rate(t + h / 2, y + h / 2 * k1)
        k3 = rate(t + h / 2, y + h / 2 * k2)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(t + h, y + h * k3))
    end = np.linalg.norm(unpack(y)[-1])
    assert start > 1.0
    assert end == pytest.approx(start * math.exp(-K_S * h * steps), rel=DECAY)


@pytest.mark.parametrize("seed", range(4))
def test_slip_energy_changes_as_in_eq_34(seed: int) -> None:
    """With the gate open and the impedance at work, v_s' vdot_s is V_s_dot with Z and the feed-forward."""
    rng = np.random.default_rng(seed)
    s = SlipDisplacement(rng.normal(scale=0.02, size=3), exponential(rng.normal(size=3)))
    R_c, v_c, v_s, h_pad, a_d = exponential(rng.normal(size=3)), *rng.normal(size=(4, 6))
    terms, law = evaluate(gains(3.0, 1e6), R_c, v_c, s, v_s, h_pad, a_d)
    assert law.gate == 1.0
    a_s = slip_acceleration(law.a_C, terms.follow, terms.v_o[3:], v_s, terms.Phi2)
    expected = V_s_dot(K_S, v_s, law.Z + a_d)
    assert v_s @ a_s == pytest.approx(expected, abs=IDENTITY)
    assert expected != pytest.approx(-2 * K_S * V_s(v_s), abs=0.1)


def test_own_acceleration_comes_back_through_an_open_gate_unless_masked() -> None:
    """Why slip_axes exists: in stick h_ee carries the pad's own acceleration, and an open gate feeds it back 1 to 1."""
    R_c, v_c, s = np.eye(3), np.zeros(6), SlipDisplacement(np.zeros(3), np.eye(3))
    contact = Contact(np.zeros(3), np.eye(3), np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0]))
    a_now = np.array([0.0, 0.0, 0.7, 0.2, 0.0, 0.0])
    h = np.concatenate((MODEL.mass * (MODEL.gravity - a_now[:3]), -MODEL.inertia @ a_now[3:]))
    v_s = np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    v_c = v_s.copy()
    terms = grasp_terms(MODEL, [contact], [s], [h], R_c, v_c, v_s)
    np.testing.assert_allclose(terms.follow, a_now, atol=IDENTITY)
    attitude = log_error(R_c, np.eye(3), v_c[3:], np.zeros(3), np.zeros(3), np.zeros(3))
    gain = gains(1e-12, 1e6)

    def a_C(axes: np.ndarray) -> np.ndarray:
        return control_law(gain, axes, attitude, np.zeros(3), v_c[:3], np.zeros(6), R_c, v_s, terms).a_C

    np.testing.assert_allclose(a_C(np.ones(6))[2:4], a_now[2:4], atol=IDENTITY)
    np.testing.assert_allclose(a_C(contact.slip_axes)[2:4], 0.0, atol=IDENTITY)


@pytest.mark.parametrize("seed", [1, 2])
def test_object_state_follows_from_pad_and_slip_alone(seed: int) -> None:
    """Attitude, arm and twist of the object, reconstructed from the pad, equal those the pad was made from."""
    rng = np.random.default_rng(seed)
    R_o, v_o = exponential(rng.normal(size=3)), rng.normal(size=6)
    s = SlipDisplacement(rng.normal(scale=0.1, size=3), exponential(rng.normal(size=3)))
    v_s, r = rng.normal(size=6), grasp.contact_arm(R_o, CONTACT, s)
    R_c = grasp.pad_rotation(R_o, CONTACT, s)
    v_c = np.concatenate((v_o[:3] + np.cross(v_o[3:], r), v_o[3:])) + v_s
    terms = grasp_terms(MODEL, [CONTACT], [s], [np.zeros(6)], R_c, v_c, v_s)
    np.testing.assert_allclose(terms.R_o, R_o, atol=IDENTITY)
    np.testing.assert_allclose(terms.r, r, atol=IDENTITY)
    np.testing.assert_allclose(terms.v_o, v_o, atol=IDENTITY)
