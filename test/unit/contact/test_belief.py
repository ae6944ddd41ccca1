"""The belief about friction: its prior, what sticks and slides teach it, and the load that the motion needs."""

import numpy as np
import pytest
from scipy.stats import norm

from slip_vic_controller.contact.belief import (
    BELIEF_TUNING,
    PRIOR,
    PRIORS,
    RATIO,
    Belief,
    certain_share,
    change_friction,
    keep_past,
    see_load,
    see_slip,
    sliding,
    start_belief,
)
from test.support.call import blank, call

F, DT, MS = 1.0, 1e-3, 1_000_000
CELL = np.expm1(BELIEF_TUNING.step)
K = np.exp(-BELIEF_TUNING.slides_cells * BELIEF_TUNING.step)


def belief(load=0.3):
    """Return a belief at rest with a load [N]; friction is configured as 1 N."""
    state = blank(Belief)
    call(start_belief, state, load, F)
    return state


def ride(state, measured, commanded, seconds):
    """Take in constant loads [N]."""
    for _ in range(round(seconds / DT)):
        call(see_load, state, np.array([measured, 0, 0, 0, 0, 0]), commanded, F, DT)


def all_of(state):
    """Return P(r_i) of all hypotheses."""
    return np.array(state.sticks) + np.array(state.slides)


@pytest.mark.parametrize("risk", [1e-3, 0.02, 0.3])
def test_prior_is_lognormal(risk) -> None:
    exact = np.exp(norm.ppf(risk) * BELIEF_TUNING.spread)
    assert call(certain_share, belief(), risk) == pytest.approx(exact, rel=0.5 * CELL)


def test_strongest_friction_is_believed_too() -> None:
    state = blank(Belief)
    state.sticks[-1] = 1.0
    assert call(certain_share, state, 0.5) == pytest.approx(RATIO[-1])


def test_what_is_carried_excludes_weaker_friction() -> None:
    state = belief()
    ride(state, 0.3, 0.3, 0.1)
    ride(state, 0.9, 0.9, 0.3)
    assert all_of(state).sum() == pytest.approx(1.0, abs=1e-12)
    assert sliding(state) < 0.1
    assert all_of(state)[RATIO < 0.85].sum() < 0.02
    assert 0.75 < call(certain_share, state, 0.02) < 0.95


def test_slip_shows_friction_and_keeps_the_load() -> None:
    """Friction is 0.6 of what is configured: from 0.3 N the load rises to 0.9 N, and k 0.6 N are carried."""
    state = belief()
    for load in np.arange(0.3, 0.9, 3.0 * DT):
        ride(state, load if load < 0.6 else K * 0.6, load, DT)
    ride(state, K * 0.6, 0.9, 0.1)
    assert sliding(state) > 0.9
    assert call(certain_share, state, 0.5) == pytest.approx(K * 0.6, rel=2 * CELL)
    assert state.needed > 0.8, "the wrench is followed only as far as the object sticks"


def test_wrong_mass_is_no_slip() -> None:
    """An object of 0.8 of the mass carries 0.8 of every load that the model needs."""
    state, rng = belief(0.24), np.random.default_rng(1)
    for load in 0.3 + 0.2 * np.sin(np.arange(0, 2.0, DT) * 9.0):
        wrench = np.array([0.8 * load, 0, 0, 0, 0, 0]) + 0.01 * rng.normal(size=6)
        call(see_load, state, wrench, load, F, DT)
    assert sliding(state) < 0.05
    # The means are 0.8 of what the model needs; only what has changed since then counts in full.
    assert state.needed == pytest.approx(0.8 * load + 0.2 * (load - state.commanded), abs=0.002)


def test_sample_is_bayes_rule_at_its_stamp() -> None:
    states = [belief(), belief()]
    for state in states:
        ride(state, 0.3, 0.3, 0.05)
        ride(state, 0.5, 0.9, 0.01)
        call(keep_past, state, 0)
    a, b = np.array(states[0].sticks), np.array(states[0].slides)
    b_after, a_after = b, BELIEF_TUNING.outlier * a
    call(see_slip, states[0], 0, 1.0, 0.01)
    np.testing.assert_allclose(states[0].slides, b_after / (a_after + b_after).sum(), atol=1e-12)
    call(keep_past, states[1], 100 * MS)
    call(see_slip, states[1], 100 * MS, 1.0, 0.01)
    np.testing.assert_allclose(states[1].slides, states[0].slides, atol=1e-15)
    call(see_slip, states[0], 10 * MS, 0.0, 0.01)
    assert sliding(states[0]) < sliding(states[1]), "a reading of none denies it"
    ride(states[1], 0.5, 0.9, 0.1)
    call(see_slip, states[1], 0, 1.0, 0.01)  # late, of a time at which less was known
    assert np.min(states[1].sticks) == 0.0


def test_shares_of_friction_alone_count() -> None:
    one, other = blank(Belief), blank(Belief)
    for of, state in ((1.0, one), (3.0, other)):
        call(start_belief, state, 0.3 * of, F * of)
        for load in np.linspace(0.3, 0.9, 40):
            call(see_load, state, of * np.array([min(load, K * 0.6), 0, 0, 0, 0, 0]), load * of, F * of, 5.0 * DT)
    np.testing.assert_allclose(other.slides, one.slides, rtol=1e-6, atol=1e-12)
    assert sliding(one) > 0.5


def test_noise_is_found() -> None:
    state, rng, raw = belief(), np.random.default_rng(2), 0.05
    for _ in range(3000):
        wrench = np.array([0.5 + raw * rng.normal(), raw * rng.normal(), 0, 0, 0, 0])
        call(see_load, state, wrench, 0.5, F, DT)
    share = -np.expm1(-DT / BELIEF_TUNING.wrench_s)
    assert state.noise == pytest.approx(raw * np.sqrt(share / (2.0 - share)), rel=0.2)


@pytest.mark.parametrize("load", [0.09, 0.9])
def test_noise_is_no_load_that_friction_carries(load) -> None:
    """The peaks of a noisy wrench teach no friction: with a probe of 0.01 N the squeeze still carries the load."""
    state, rng, carried = belief(load), np.random.default_rng(3), load / 0.9
    for _ in range(10_000):
        wrench = np.array([load + 0.1 * rng.normal(), 0.1 * rng.normal(), 0, 0, 0, 0])
        call(see_load, state, wrench, load, carried * F, DT)
    assert load * call(certain_share, state, 0.01) < load + 0.01


def test_belief_without_evidence_returns_to_the_prior() -> None:
    state = belief()
    ride(state, 0.9, 0.9, 0.3)
    for _ in range(600):
        call(change_friction, state, 2.0)
    np.testing.assert_allclose(all_of(state), PRIOR / PRIORS, rtol=1e-2)
