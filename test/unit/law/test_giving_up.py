"""When the compensation is given up and taken up again."""

from __future__ import annotations

import numpy as np

from slip_core.records import new, record
from slip_vic_controller.law.gains import GAINS
from slip_vic_controller.law.giving_up import GIVEN_UP, GIVING_UP, judge_compensation
from test.support.call import call

SLIPS, STICKS = np.array([0.005, 0.0, 0.0, 0.0, 0.0, 0.0]), np.zeros(6)
MS = 1e-3


class Judge:
    """What runs; every cycle begins with full gains, as in the control cycle."""

    def __init__(self, on: bool = True, witness: bool = False) -> None:
        self.config, self.state = new(GIVING_UP), new(GIVEN_UP)
        config = record(self.config, GIVING_UP)
        config.on, config.witness, config.error, config.fall = int(on), int(witness), 0.02, 0.1
        config.longest_s, config.calm_s, config.speed, config.fast_s = 0.15, 0.15, 0.08, 0.01

    def cycles(self, v_s: np.ndarray, seconds: float, error: float = 0.0, fall: float = 0.0, seen: bool = True) -> bool:
        """Return whether the compensation is given up after so long."""
        for _ in range(round(seconds / MS)):
            gains = new(GAINS)
            g = record(gains, GAINS)
            g.alpha, g.characteristic_length, g.gamma_k[:], g.gamma_d[:] = 220.0, 0.03, 100.0, 100.0
            full = gains.copy()
            call(judge_compensation, self.config, self.state, gains, v_s, int(seen), error, fall, MS)
            given_up = bool(record(self.state, GIVEN_UP).given_up)
            impedance_alone = g.alpha == 0.0 and not g.gamma_k.any() and not g.gamma_d.any()
            shut = given_up or (bool(record(self.config, GIVING_UP).witness) and not seen)
            assert impedance_alone if shut else gains.tobytes() == full.tobytes()
        return given_up


def test_a_short_slip_is_the_laws_business() -> None:
    judge = Judge()
    for _ in range(5):
        assert not judge.cycles(SLIPS, 0.1)
        assert not judge.cycles(STICKS, 0.1)


def test_a_slip_that_does_not_end_is_given_up_until_it_has_been_over_for_as_long() -> None:
    judge = Judge()
    assert not judge.cycles(SLIPS, 0.148)
    assert judge.cycles(SLIPS, 0.004)
    assert judge.cycles(SLIPS, 1.0)
    assert judge.cycles(STICKS, 0.148)
    assert not judge.cycles(STICKS, 0.004)
    assert record(judge.state, GIVEN_UP).times == 1


def test_an_activation_that_flickers_is_open() -> None:
    """Noise of the wrench: three of four cycles beyond what counts as open."""
    judge = Judge()
    given_up = [judge.cycles(STICKS if k % 4 == 0 else SLIPS, MS) for k in range(400)]
    assert not given_up[200]
    assert given_up[-1]


def test_an_arm_that_gives_way_far_meanwhile_ends_it_at_once() -> None:
    judge = Judge()
    judge.cycles(STICKS, 0.1, error=0.01)  # an error from before counts for nothing
    assert not judge.cycles(SLIPS, 0.01, error=0.029)
    assert judge.cycles(SLIPS, 0.001, error=0.031)
    assert judge.cycles(STICKS, 0.148, error=0.0)


def test_a_slip_that_grows_faster_than_it_is_answered_ends_it() -> None:
    """Arm and object swing against each other: behind late drives the gate then feeds what it should end.

    Not at once: an estimate that begins with a wrong model is as fast for some cycles.
    """
    for turning in (False, True):
        fast = np.zeros(6)
        fast[5 if turning else 0] = 0.1 / (0.03 if turning else 1.0)
        judge = Judge()
        assert not judge.cycles(0.7 * fast, 0.02)
        assert not judge.cycles(fast, 0.008)
        assert not judge.cycles(0.7 * fast, 0.02)
        assert judge.cycles(fast, 0.012)
        assert judge.cycles(STICKS, 0.148)
        assert not judge.cycles(STICKS, 0.004)


def test_an_arm_that_falls_with_the_gate_open_ends_it_too() -> None:
    judge = Judge()
    assert not judge.cycles(SLIPS, 0.01, fall=0.09)
    assert judge.cycles(SLIPS, 0.001, fall=0.11)
    judge = Judge()
    assert not judge.cycles(STICKS, 0.01, fall=1.0)  # what falls while the gate is shut is none of its doing


def test_below_a_governor_the_model_alone_opens_nothing() -> None:
    """Neither does it count as open: when the sensor tells of slip, the compensation has all of its time."""
    judge = Judge(witness=True)
    assert not judge.cycles(SLIPS, 0.5, seen=False)
    assert not judge.cycles(SLIPS, 0.148)
    assert judge.cycles(SLIPS, 0.004)


def test_as_printed_it_is_never_given_up() -> None:
    judge = Judge(on=False)
    assert not judge.cycles(SLIPS, 1.0, error=1.0)
    assert not judge.state.any()
