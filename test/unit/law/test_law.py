"""The law against the independent referee, and what must hold of it whatever the numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from slip_core.errors import InputError
from slip_core.params import build
from slip_vic_controller.law.attitude import LOG_REPORT, Coordinates
from slip_vic_controller.law.config import make_law_config
from slip_vic_controller.params.controller_params import ControllerParams
from test.referees.law_referee import referee_law
from test.support.law_cases import PI, Case, random_case

REFEREE = 1e-11  # of the largest intermediate of the case: two routes through inverses of well-scaled matrices
TORQUE = 1e-8  # relative to the largest torque: random inertia matrices have condition numbers up to 1e3, squared
SIX = ("v_s", "e", "e_dot", "K", "D", "comp", "Lambda", "Theta", "Z", "a_d", "a_C", "h_ee", "h_o", "v_o", "a_o", "Phi2")
AXES = ("x", "y", "z", "rx", "ry", "rz")


GROUPS: dict[str, list[dict[str, Any]]] = {
    "joints and contacts": [
        {"seed": seed, "joints": joints, "contacts": contacts, "attitude": attitude, "observed": seed % 2 == 1}
        for seed in range(2)
        for joints in range(3, 8)
        for contacts in (1, 2, 3)
        for attitude in (Coordinates.LOG, Coordinates.RPY)
    ],
    "angles": [
        {"seed": seed, "angle": angle}
        for seed in range(2)
        for angle in (0.0, 1e-9, 0.0999, 0.1001, 1.0, 2.0, 2.2, PI - 0.21, PI - 0.19, PI - 1e-3)
    ],
    "slip": [{"seed": seed, "slip": slip} for seed in range(2) for slip in (0.0, 1e-12, 1e-3, 10.0)],
    "spin": [{"seed": seed, "spin_limit": most, "length": 0.03} for seed in range(2) for most in (0.0, 1.0, 1e9)],
    "printed axes": [{"seed": seed, "slip_axes": (1,) * 6} for seed in range(3)],
    "internal": [{"seed": seed, "contacts": contacts, "kappa": 0.7} for seed in range(2) for contacts in (2, 3, 4)],
}


def assert_equal(case: Case) -> dict[str, Any]:
    """Compare every published symbol and the torque with the referee's; return the referee's."""
    found, expected = case.evaluate(), referee_law(case.referee())
    assert found.ok
    symbols = case.symbols()
    large = ("Z", "Theta", "a_o", "Phi2", "a_C", "e_dot")
    scale = max(1.0, case.gains.gains.k_s * np.abs(case.v_s).max(), *(np.abs(expected[name]).max() for name in large))
    scale *= max(1.0, np.linalg.norm(expected["T_e"], 2) * np.linalg.norm(np.linalg.inv(expected["T_e"]), 2))
    for name in SIX:
        own = scale * (case.gains.gains.M_D.max() if name == "Lambda" else 1.0)
        got = [symbols[f"{name}_{axis}"] for axis in AXES]
        np.testing.assert_allclose(got, expected[name], rtol=0.0, atol=REFEREE * own, err_msg=name)
    for name in ("gate", "V_s"):
        assert symbols[name] == pytest.approx(expected[name], rel=REFEREE, abs=REFEREE), name
    assert symbols["V_e"] == pytest.approx(expected["V_e"], rel=REFEREE * scale, abs=REFEREE)
    assert symbols["damping_squared"] == pytest.approx(expected["damping_squared"], rel=1e-6, abs=REFEREE)
    assert symbols["sigma_min"] == pytest.approx(expected["sigma_min"], abs=1e-6)  # a root of a difference near zero
    n = case.joints
    largest = max(np.abs(expected["tau"]).max(), np.abs(expected["tau_task"]).max(), scale)
    torques = ("tau_task", "tau_null")
    for name in torques:
        got = [symbols[f"{name}_{j + 1}"] for j in range(n)]
        np.testing.assert_allclose(got, expected[name], rtol=0.0, atol=TORQUE * largest, err_msg=name)
    np.testing.assert_allclose(found.tau[:n], expected["tau"], rtol=0.0, atol=TORQUE * largest)
    limit = case.config.effort_limit[:n]
    assert (found.effort[:n] == np.clip(found.tau[:n], -limit, limit)).all()
    assert (found.saturated[:n] == (np.abs(found.tau[:n]) > limit)).all()
    internal = np.kron(np.eye(2), case.arm.rotation.T) @ expected["h_int"] if case.contacts > 1 else np.zeros(6)
    np.testing.assert_allclose(found.h_int, internal, rtol=0.0, atol=REFEREE * scale)
    carried = expected["follow"] + expected["Phi2"] + np.kron(np.eye(2), case.arm.rotation) @ case.follow_error
    np.testing.assert_allclose(found.carried, carried[:3], rtol=0.0, atol=REFEREE * scale)
    assert found.error_linear == pytest.approx(np.linalg.norm(expected["e"][:3]), abs=REFEREE * scale)
    assert found.error_angular == pytest.approx(np.linalg.norm(expected["e"][3:]), abs=REFEREE * scale)
    assert found.slip_speed == pytest.approx(np.linalg.norm(expected["v_s"][:3]), abs=REFEREE)
    if case.config.attitude == Coordinates.LOG:
        assert found.near_singular_attitude == (found.error_angular > LOG_REPORT)
    return expected


@pytest.mark.parametrize("group", GROUPS)
def test_law_equals_referee(group: str) -> None:
    for values in GROUPS[group]:
        assert_equal(random_case(**values))


@pytest.mark.parametrize("seed", range(3))
def test_branch_beyond_the_half_turn(seed: int) -> None:
    case = random_case(seed, angle=PI - 0.3)
    case.previous[:] = 0.0
    error = np.array(case.evaluate().e[3:])
    sizes = []
    for previous in (error, -error):
        case.previous = previous
        assert_equal(case)
        sizes.append(case.evaluate().error_angular)
    np.testing.assert_allclose(sizes, [PI - 0.3, PI + 0.3], atol=REFEREE)


def test_the_comparison_sees_a_difference() -> None:
    """Neither a gain that is off by a billionth nor a wrong sign escapes."""
    case = random_case(0)
    case.evaluate()
    right = case.referee()
    right.gains.k_s *= 1.0 + 1e-9
    a_C = [case.symbols()[f"a_C_{axis}"] for axis in AXES]
    np.testing.assert_allclose(a_C, referee_law(case.referee())["a_C"], rtol=0.0, atol=1e-10)
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(a_C, referee_law(right)["a_C"], rtol=0.0, atol=1e-10)
    case.reference.rotation[:] = case.reference.rotation.T.copy()
    with pytest.raises(AssertionError):
        np.testing.assert_allclose(a_C, referee_law(case.referee())["a_C"], rtol=0.0, atol=1e-3)


def test_classical_is_the_law_with_gate_and_fading_off() -> None:
    """The slip velocity changes nothing in the classical torque, and the gate is exactly zero."""
    case = random_case(3, slip_axes=(1, 1, 1, 1, 1, 1))
    case.gains.gains.alpha = 0.0
    case.gains.gains.gamma_k[:] = case.gains.gains.gamma_d[:] = 0.0
    moving = case.evaluate().copy()
    assert moving.gate == 0.0
    assert (moving.K == case.gains.gains.K_D).all()
    torque = moving.tau.copy()
    case.samples[0].slip_twist[:] = 0.0
    assert (case.evaluate().tau == torque).all()


@pytest.mark.parametrize("number", [math.nan, math.inf, 1e200])
@pytest.mark.parametrize("place", ["wrench", "bias", "twist", "slip position", "slip rotation"])
def test_what_is_not_finite_is_not_ok(place: str, number: float) -> None:
    case = random_case(1, contacts=2)
    assert case.evaluate().ok
    slip, unused = case.slips[1], case.slips[2]
    unused.position[:] = number
    assert case.evaluate().ok
    {
        "wrench": case.samples[1].wrench,
        "bias": case.arm.bias,
        "twist": case.reference.twist,
        "slip position": slip.position,
        "slip rotation": slip.rotation[2],
    }[place][2] = number
    assert not case.evaluate().ok


def test_a_negative_mass_matrix_is_reported() -> None:
    case = random_case(0)
    case.arm.M[:] *= -1.0
    assert not case.evaluate().ok


def test_unused_joints_and_contacts_change_nothing() -> None:
    case = random_case(4, joints=6, contacts=2)
    before = np.array(case.evaluate().tau)
    case.arm.J[:, 6:], case.arm.M[6:], case.arm.bias[6:] = 7.0, 7.0, 7.0
    case.samples[2].wrench[:] = case.config.contact[3].position[:] = math.nan
    after = case.evaluate()
    assert after.ok
    assert (after.tau[:6] == before[:6]).all()


@pytest.mark.parametrize("contacts", [1, 3])
@pytest.mark.parametrize("seed", range(4))
def test_motion_for_the_observer(seed: int, contacts: int) -> None:
    """G^T a_o + Phi2 and its parts are the referee's, for the slip velocity of the observer."""
    case = random_case(seed, contacts=contacts, slip_axes=(1, 1, 1, 1, 1, 1))
    expected = referee_law(case.referee())
    finite, motion = case.motion(case.v_s)
    assert finite
    gravity = np.concatenate((case.gains.object.gravity, np.zeros(3)))
    scale = max(1.0, np.abs(expected["a_o"]).max())
    for name, value in {
        "rotation": case.arm.rotation,
        "v_ee": case.arm.twist,
        "follow": expected["follow"] + expected["Phi2"],
        "force": expected["follow"] - gravity,
        "drag": -expected["h_ee"][:3] / case.gains.object.mass,
        "w_o": expected["w_o"],
    }.items():
        np.testing.assert_allclose(motion[name], value, rtol=0.0, atol=REFEREE * scale, err_msg=name)


@pytest.mark.parametrize("contact", [0, 1])
@pytest.mark.parametrize("name", ["wrench", "slip_twist"])
def test_samples_for_the_observer_must_be_finite(contact: int, name: str) -> None:
    case = random_case(1, contacts=2)
    assert case.motion(np.zeros(6))[0]
    case.samples[contact][name][3] = math.nan
    assert not case.motion(np.zeros(6))[0]


def test_more_contacts_than_places_are_refused() -> None:
    many = {"position": (0.0,) * 15, "orientation_xyzw": (0.0, 0.0, 0.0, 1.0) * 5, "slip_axes": (True,) * 30}
    with pytest.raises(InputError, match="at most 4"):
        make_law_config(build(ControllerParams, {"contacts": many}, "test"), np.full(6, 30.0), np.ones(6))


@pytest.mark.parametrize("seed", range(3))
def test_a_scaled_acceleration_scales_the_torque(seed: int) -> None:
    """The effort is affine in the factor and clipped again."""
    case = random_case(seed)
    case.config.effort_limit[: case.joints] = 1e9
    none, half, whole = (case.evaluate(factor).effort[: case.joints].copy() for factor in (0.0, 0.5, 1.0))
    np.testing.assert_allclose(half, 0.5 * (none + whole), rtol=0.0, atol=TORQUE * np.abs(whole).max())
    np.testing.assert_allclose(case.evaluate().effort[: case.joints], whole, rtol=TORQUE)
    case.config.effort_limit[: case.joints] = np.abs(half) + 1e-3
    assert case.evaluate().saturated.any()
    found = case.evaluate(0.5)
    assert found.ok
    assert not found.saturated.any()
    np.testing.assert_allclose(found.effort[: case.joints], half, rtol=TORQUE)


def test_what_is_ok_is_finite_and_limited() -> None:
    rng, good = np.random.default_rng(0), 0
    for trial in range(400):
        case = random_case(trial, contacts=1 + trial % 3, attitude=trial % 2)
        buffer = case.buffers[rng.integers(1, len(case.buffers))]
        numbers = (0.0, 5e-324, 1e-300, -1e-9, 1e3, 1e9, 1e154, -1e300, math.inf, math.nan)
        buffer[rng.integers(0, buffer.size, 1 + trial % 4)] = rng.choice(numbers)
        found = case.evaluate()
        good += found.ok
        if found.ok:
            assert np.isfinite(found.tau).all()
            assert (np.abs(found.effort) <= case.config.effort_limit).all()
            assert np.isfinite(found.e).all()
    assert 40 < good < 390
