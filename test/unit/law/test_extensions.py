"""What is added to the printed law: slip speed, bounds on spin and authority, dead band, giving up."""

from __future__ import annotations

import math

import numpy as np
import pytest

from slip_core.records import dtype_of, new, record
from slip_vic_controller.law import extensions
from slip_vic_controller.law.config import YIELDS_M
from slip_vic_controller.law.extensions import CompensationState
from slip_vic_controller.law.gains import Gains
from test.support.call import call, flat
from test.support.law_cases import random_case

GAINS = dtype_of(Gains)
GIVEN_UP = dtype_of(CompensationState)

SLIPS, STICKS = np.array([0.005, 0.0, 0.0, 0.0, 0.0, 0.0]), np.zeros(6)
MS = 1e-3


def test_characteristic_length_scales_turning() -> None:
    buffer, v_s = new(GAINS), np.array([0.003, 0.0, 0.0, 0.0, 0.0, 0.004])
    for length in (1.0, 0.5):
        record(buffer, GAINS).characteristic_length = length
        assert call(extensions.slip_speed, buffer, v_s) == pytest.approx(math.hypot(3e-3, length * 4e-3), rel=1e-12)


def test_spin_is_shortened_to_its_limit() -> None:
    motion = np.array([1.0, -2.0, 3.0, 0.0, 3.0, -4.0])
    assert (flat(call(extensions.limit_spin, 5.0, motion)) == motion).all()
    shortened = flat(call(extensions.limit_spin, 0.5, motion))
    np.testing.assert_allclose(shortened, [1.0, -2.0, 3.0, 0.0, 0.3, -0.4], rtol=1e-12)
    assert (flat(call(extensions.limit_spin, 0.0, motion))[3:] == 0.0).all()


def test_authority_ends_far_off_the_reference() -> None:
    assert call(extensions.authority, YIELDS_M, 0.0) == 1.0
    assert call(extensions.authority, YIELDS_M, 0.15) > 0.9, "an object that friction brakes takes the arm so far"
    assert call(extensions.authority, YIELDS_M, YIELDS_M) == call(extensions.authority, YIELDS_M, 1.0) == 0.0
    assert call(extensions.authority, math.inf, 1.0) == 1.0


@pytest.mark.parametrize("far", [0.0, 1.0])
def test_an_open_gate_replaces_the_impedance(far: float) -> None:
    """Near the reference a_C is Theta + compensation on the slip axes, far off it is the impedance of full gains."""
    case = random_case(4, slip=10.0, slip_axes=(1, 1, 1, 0, 0, 0))
    case.gains.gains.alpha, case.config.yields = 1e3, YIELDS_M
    case.arm.position[:] = case.reference.position + np.array([far, 0.0, 0.0])
    found, R = case.evaluate(), np.array(case.arm.rotation)
    assert found.gate == 1.0 - far
    expected = found.a_d + found.Z + found.Theta
    if far == 0.0:
        expected[:3] = found.Theta[:3] + R @ found.comp[:3]
    else:
        assert (found.K == case.gains.gains.K_D).all()
    np.testing.assert_allclose(found.a_C, expected, rtol=1e-9, atol=1e-9)


class Judge:
    """`judge_compensation` over some cycles; each starts with full gains, as in the control cycle."""

    def __init__(self) -> None:
        self.state = new(GIVEN_UP)

    def cycles(self, v_s: np.ndarray, seconds: float, fall: float = 0.0) -> bool:
        """Return whether the compensation is given up after so long."""
        for _ in range(round(seconds / MS)):
            gains = new(GAINS)
            g = record(gains, GAINS)
            g.alpha, g.characteristic_length, g.gamma_k[:], g.gamma_d[:] = 220.0, 0.03, 100.0, 100.0
            full = gains.copy()
            call(extensions.judge_compensation, self.state, gains, v_s, fall, MS)
            given_up = bool(record(self.state, GIVEN_UP).left_s > 0.0)
            impedance_alone = g.alpha == 0.0 and not g.gamma_k.any() and not g.gamma_d.any()
            assert impedance_alone if given_up else gains.tobytes() == full.tobytes()
        return given_up


def test_slow_slips_are_compensated() -> None:
    judge = Judge()
    assert not judge.cycles(SLIPS, 1.0)
    assert not judge.cycles(STICKS, 0.1)


def test_it_resumes_when_the_gate_is_shut() -> None:
    judge = Judge()
    assert judge.cycles(SLIPS, 0.001, fall=1.1 * extensions.FALLS_M_S)
    assert judge.cycles(SLIPS, 1.0)
    assert judge.cycles(STICKS, extensions.CALM_S - 0.002)
    assert not judge.cycles(STICKS, 0.004)


@pytest.mark.parametrize("turning", [False, True])
def test_a_fast_slip_ends_it(turning: bool) -> None:
    fast = np.zeros(6)
    fast[5 if turning else 0] = 0.1 / (0.03 if turning else 1.0)
    judge = Judge()
    assert not judge.cycles(fast, 0.008)
    assert not judge.cycles(0.7 * fast, 0.02)
    assert judge.cycles(fast, 0.012)


def test_a_fall_with_the_gate_open_ends_it() -> None:
    judge = Judge()
    assert not judge.cycles(SLIPS, 0.01, fall=0.9 * extensions.FALLS_M_S)
    assert judge.cycles(SLIPS, 0.001, fall=1.1 * extensions.FALLS_M_S)
    assert not Judge().cycles(STICKS, 0.01, fall=1.0)
