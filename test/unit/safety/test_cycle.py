"""The control cycle as a whole: safe on any input, a function of state and inputs, and what the law is given."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slip_core.records import new, record
from slip_core.types import CartesianReference, JointSample, WrenchSample
from slip_vic_controller.cycle.cycle import cycle
from slip_vic_controller.cycle.sensing import limit_internal_gain
from slip_vic_controller.safety.conditions import Mode, Reason
from slip_vic_controller.session.cycle_result import Health
from slip_vic_controller.state import ARM_STATE, CONFIG, OUTPUTS
from test.referees.law_referee import exponential
from test.support import made_up as support
from test.support.call import call
from test.support.made_up import CALM, LOAD, MS, POSITION, SLIP, STAMP_NS, VELOCITY, MadeUp, N

ROUNDING = 1e-10
NAN, INF = float("nan"), float("inf")
ZERO = np.zeros(6)
SLOW = {"gains__k_s": 100.0}  # what the estimator allows at once


def law_at_work(**values) -> MadeUp:
    return support.law_at_work(**{**CALM, **values})


def with_value(values, index: int, value: float) -> np.ndarray:
    out = np.array(values, dtype=float)
    out[index] = value
    return out


def inside(made_up: MadeUp, result) -> None:
    assert np.isfinite(result.command.numbers).all()
    assert (np.abs(result.command.numbers) <= made_up.controller.first.robot.effort_limit).all()


# -- bad input ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", ["joint", "wrench", "slip"])
def test_unusable_input_gives_safe_command(part: str) -> None:
    """HOLD with its reason, memory of the law as before; the law resumes by itself."""
    made_up = law_at_work(slip_estimator="observer", **SLOW)
    before = np.array(made_up.run(3).record.law.e[3:])
    joint = made_up.joint(velocity=np.full(N, 1e140)) if part == "joint" else made_up.joint()
    wrench = with_value(LOAD, 0, NAN) if part == "wrench" else LOAD
    slip = with_value(SLIP, 5, INF) if part == "slip" else SLIP
    result = made_up.past_validation(joint, wrench, slip)
    inside(made_up, result)
    assert (result.mode, result.record.ok) == (Mode.HOLD, False)
    assert result.reason in ("the torque of the law is not finite", "the slip estimate is not finite")
    np.testing.assert_allclose(made_up.state.law.e_previous, before, atol=1e-2)
    np.testing.assert_array_equal(made_up.state.hold.posture[:N], joint.position)
    assert made_up.run(30).reason == f"resumes after: {result.reason}"
    begun = next(one for one in (made_up.run(1) for _ in range(200)) if one.mode.follows)
    assert not begun.record.reference.twist.any(), "it begins at rest"
    assert np.isfinite(made_up.state.observer.twist).all()


def test_failed_law_holds_as_any_other() -> None:
    """With the model's load where the wrench is no number, as where it cannot be used."""
    wanted = []
    for load, health in ((with_value(LOAD, 2, NAN), None), (LOAD, Health(wrench=Reason.FUTURE))):
        made_up = law_at_work()
        joint = made_up.joint(velocity=np.linspace(-0.5, 0.5, N))
        result = made_up.past_validation(joint, load, health=health)
        assert result.mode == Mode.HOLD
        wanted.append(result.record.wanted[:N].copy())
        inside(made_up, result)
    np.testing.assert_allclose(wanted[0], wanted[1], atol=ROUNDING)


@pytest.mark.parametrize(
    ("name", "value"), [("position", NAN), ("rotation", INF), ("twist", NAN), ("acceleration", -INF)]
)
def test_non_finite_reference_is_refused(name: str, value: float) -> None:
    made_up = law_at_work()
    parts = {"position": np.zeros(3), "rotation": np.eye(3), "twist": ZERO, "acceleration": ZERO}
    bad = with_value(parts[name].ravel(), 2, value).reshape(parts[name].shape)
    made_up.session.set_reference(CartesianReference(**{**parts, name: bad}))
    result = made_up.cycle()
    inside(made_up, result)
    assert (result.mode, result.reason) == (Mode.HOLD, "reference is not finite")


def test_wrong_stamps_lead_to_gravity_compensation() -> None:
    """Nothing tells where the model has the arm then: for how long it has moved is not known."""
    made_up = law_at_work()
    good = made_up.run(20)
    for _ in range(150):
        made_up.pass_time()
        old = JointSample(good.joint.stamp_ns, POSITION, VELOCITY, np.zeros(N))
        made_up.session.add_joint(old, made_up.now_ns)
        made_up.session.give(old, [WrenchSample(made_up.stamp_ns, LOAD)], [None], [])
        fault = Reason.OUT_OF_ORDER
        bad = made_up.session.answer(old, fault, made_up.now_ns, 0, Health(joint=fault))
        assert (bad.mode, bad.reason, bad.record.ok) == (Mode.HOLD, "joint state is out of order", False)
    expected = made_up.controller.first.robot.gravity(good.joint.position)
    np.testing.assert_allclose(bad.command.numbers, expected, atol=ROUNDING)


any_float = st.floats(allow_nan=True, allow_infinity=True, width=64)
seven, six = arrays(float, N, elements=any_float), arrays(float, 6, elements=any_float)


@given(q=seven, qd=seven, h=six, v=six, passed=st.integers(-(2**40), 2**40))
@pytest.mark.filterwarnings("error")
def test_no_input_whatever_breaks_the_cycle(q, qd, h, v, passed) -> None:
    """Past input validation, in both coordinates and with an observer."""
    for values in ({}, {"attitude": "rpy"}, {"slip_estimator": "observer"}):
        made_up = law_at_work(**SLOW, **values)
        for given_q, given_qd in ((q, qd), (POSITION, qd), (POSITION, VELOCITY)):
            result = made_up.past_validation(JointSample(made_up.stamp_ns + passed, given_q, given_qd, qd), h, v)
            inside(made_up, result)


# -- a function of state and inputs -------------------------------------------------------------------


def test_equal_buffers_give_equal_bytes() -> None:
    made_up = law_at_work()
    made_up.pass_time()
    made_up.deliver()
    made_up.session.add_joint(made_up.joint(), made_up.now_ns)
    before = made_up.session.buffer.copy()
    inputs = made_up.session.cycle(made_up.now_ns).inputs
    found = []
    for _ in range(2):
        state, exchange = before.copy(), np.concatenate((inputs, new(OUTPUTS)))
        assert cycle(made_up.controller.config, state, exchange) == 1
        found.append(state.tobytes() + exchange.tobytes())
    assert found[0] == found[1]


# -- what the law is given ----------------------------------------------------------------------------


def test_slip_displacement_is_integrated_over_cycles() -> None:
    """0.2 s at a constant slip twist, with cycles of 1, 2 and 3 ms: the displacement is the exponential's."""
    twist = np.array([0.02, -0.01, 0.0, 0.0, 0.0, 0.9])
    made_up = law_at_work()
    for k in range(100):
        noisy = twist * (1.0 + 1e-12 * (k % 2))  # equal values under new stamps were held
        made_up.past_validation(made_up.joint(velocity=np.zeros(N)), slip=noisy, passed_ns=(1 + k % 3) * MS)
    t, slip = (made_up.stamp_ns - STAMP_NS) * 1e-9, made_up.state.law.slips[0]
    angle = twist[5] * t
    V = np.array([[np.sin(angle), np.cos(angle) - 1.0], [1.0 - np.cos(angle), np.sin(angle)]]) / angle
    np.testing.assert_allclose(slip.rotation, exponential(twist[3:] * t), atol=1e-8)
    np.testing.assert_allclose(slip.position[:2], V @ twist[:2] * t, atol=1e-8)


# -- what is published --------------------------------------------------------------------------------


def test_singular_posture_is_reported() -> None:
    made_up = MadeUp()
    result = made_up.cycle(made_up.joint(np.zeros(N), np.zeros(N)), slip=ZERO, passed_ns=0)
    assert result.scalars()["near_singular_arm"] == 1.0
    inside(made_up, result)


def test_numbers_of_the_ledger() -> None:
    """Cycle, stamps of what was used, clock, mode, health and request: all that a replay needs."""
    made_up = law_at_work()
    result = made_up.run(1)
    sec, nanosec = divmod(made_up.stamp_ns, 10**9)
    assert result.ledger == (1, sec, nanosec, sec, nanosec, sec, nanosec)
    assert result.decision == (*divmod(made_up.now_ns, 10**9), Mode.ACTIVE, 0, 0)
    made_up.session.set_publishers({"wrench": 2}, 1)
    bad = made_up.run(1, slip=np.full(6, NAN))
    found = Health(slip=Reason.INVALID, outside=Reason.SECOND_PUBLISHER)
    assert Health.from_code(bad.decision[3]) == found
    assert bad.decision[2] == Mode.HOLD
    assert bad.ledger[0] == 2


def test_kappa_bounded_by_delay() -> None:
    config, state, outputs = (record(new(of), of) for of in (CONFIG, ARM_STATE, OUTPUTS))
    config.law.contacts, config.period_ns, config.pad_stiffness = 2, MS, 1e4
    outputs.gains.gains.M_D[:3] = 2.0, 1.0, 3.0
    for share, lag_s, late_ms, kappa in itertools.product(
        (0.5, 1.0), (0.0, 0.003), ((0, 0), (1, 5), (5, 1)), (0.05, 1e3)
    ):
        config.kappa_share, config.drive_lag_s = share, lag_s
        state.joint.answers.stamp_ns, outputs.gains.gains.kappa = 9 * MS, kappa
        for k in range(2):
            state.wrench_inputs[k].stamp_ns = (9 - late_ms[k]) * MS
        call(limit_internal_gain, config, state, outputs)
        most = share * 0.38 / (1e4 * (lag_s + 1e-3 * (1 + max(late_ms))) ** 2)
        assert outputs.gains.gains.kappa == pytest.approx(min(kappa, most))


def test_a_cycle_without_faults_counts_none() -> None:
    made_up = MadeUp()
    assert made_up.cycle(slip=None).reason == "waits for slip of contact 0"
    assert made_up.cycle().mode.follows
    assert made_up.session.counts() == {}


ONE_NAN = np.where(np.arange(N) == 2, np.nan, 0.0)


@pytest.mark.parametrize(
    ("shift_ns", "changes", "mode", "words"),
    [
        (-(10**18), {}, Mode.WAITING_INPUT, "waits for a good joint state (it has no stamp)"),
        (
            0,
            {"position": np.degrees(POSITION)},
            Mode.WAITING_INPUT,
            "a good joint state (it is absurdly large: wrong unit?)",
        ),
        (0, {"velocity": ONE_NAN}, Mode.WAITING_INPUT, "a good joint state (it is not finite)"),
        (10**9, {}, Mode.HOLD, "an input has stamps ahead of all others: joint_states"),
    ],
)
def test_bad_joint_states_are_named(shift_ns: int, changes: dict[str, Any], mode: Mode, words: str) -> None:
    made_up = MadeUp()
    for _ in range(5):
        made_up.pass_time()
        made_up.deliver()
        joint = made_up.joint(**{"velocity": np.zeros(N), **changes})
        made_up.session.add_joint(replace(joint, stamp_ns=max(joint.stamp_ns + shift_ns, 0)), made_up.now_ns)
        result = made_up.session.cycle(made_up.now_ns)
    assert result is not None
    assert result.mode == mode
    assert words in result.reason
