"""The control cycle as a whole: safe on any input, a function of state and inputs, and what the law is given."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from slip_core.errors import InputError
from slip_core.records import new, record, records
from slip_core.types import CartesianReference, JointSample, SlipSample, WrenchSample
from slip_vic_controller.cycle.agreeing import begin_together
from slip_vic_controller.cycle.cycle import cycle
from slip_vic_controller.cycle.gains import limit_internal_gain
from slip_vic_controller.cycle.taring import all_at_rest
from slip_vic_controller.law.bounds import held_sample_limit, internal_gain_limit
from slip_vic_controller.safety.faults import Fault
from slip_vic_controller.safety.modes import Mode
from slip_vic_controller.session.cycle_result import CycleResult, Health
from slip_vic_controller.state import ARM_STATE, CONFIG, INPUTS, OUTPUTS, TASK_STATE
from test.referees.law_referee import exponential
from test.support import made_up as support
from test.support.call import call
from test.support.made_up import LOAD, MS, POSITION, SLIP, STAMP_NS, VELOCITY, MadeUp, N

ROUNDING = 1e-10
NAN, INF = float("nan"), float("inf")
ZERO = np.zeros(6)
QUINTIC = {"trajectory__kind": "quintic", "trajectory__displacement": (0.1, 0.0, 0.0), "trajectory__duration_s": 1.0}
SLOW = {"gains__k_s": 100.0}  # what the estimator allows at once
CALM = {
    "safety__fallback__evidence": 1e6, "safety__load__drop_speed": 1e6, "safety__limits__error_linear": 1e6,
    "safety__limits__error_angular": 1e6,
}  # fmt: skip
"""An arm that is held does not do what the law wants: nothing of that is to be a finding here."""


def law_at_work(**values) -> MadeUp:
    return support.law_at_work(**{**CALM, **values})


def with_value(values, index: int, value: float) -> np.ndarray:
    out = np.array(values, dtype=float)
    out[index] = value
    return out


def inside(made_up: MadeUp, result) -> None:
    assert np.isfinite(result.command.effort).all()
    assert (np.abs(result.command.effort) <= made_up.controller.first.robot.effort_limit).all()


# -- bad input ----------------------------------------------------------------------------------------


def bad_samples(made_up: MadeUp):
    """Return reason -> joint state, wrench and slip velocity that input validation would not let through."""
    joint = made_up.joint
    return {
        "the law gave no finite torque": (joint(velocity=np.full(N, 1e140)), LOAD, SLIP),
        "the law gave no finite torque ": (joint(), with_value(LOAD, 0, NAN), SLIP),
        "the law gave no finite torque  ": (joint(), LOAD, with_value(SLIP, 5, INF)),
        "joint state is older than the one before": (
            JointSample(made_up.stamp_ns - 2 * MS, POSITION, VELOCITY, np.zeros(N)), LOAD, SLIP,
        ),
    }  # fmt: skip


@pytest.mark.parametrize("estimator", ["measured", "observer"])
def test_what_the_law_cannot_use_gives_a_safe_command_and_a_reason(estimator: str) -> None:
    for name in bad_samples(MadeUp()):
        made_up = law_at_work(slip_estimator=estimator, **SLOW)
        made_up.run(3)
        made_up.pass_time()
        joint, wrench, slip = bad_samples(made_up)[name]
        before = made_up.session.buffer.copy()
        result = made_up.past_validation(joint, wrench, slip, passed_ns=0)
        inside(made_up, result)
        assert (result.mode, result.ok) == (Mode.HOLD, False), name
        expected = {name.strip()}
        if estimator == "observer":
            expected.add("the slip observer gave no finite estimate")
        assert result.reason in expected
        # What the law remembers is that of before; HOLD begins here.
        law = made_up.state.law
        made_up_before = MadeUp(slip_estimator=estimator, **SLOW)
        made_up_before.session.restore(before)
        np.testing.assert_array_equal(law.slips[0].position, made_up_before.state.law.slips[0].position)
        np.testing.assert_array_equal(law.e_previous, made_up_before.state.law.e_previous)
        np.testing.assert_array_equal(made_up.state.hold.posture[:N], joint.position)
        made_up.pass_time(MS)
        assert made_up.run(30).reason == f"resumes after: {result.reason}"
        assert made_up.run(200).mode.follows
        assert np.isfinite(made_up.state.observer.twist).all()


def test_the_safe_command_holds_against_gravity_and_brakes() -> None:
    made_up = law_at_work()
    joint = made_up.joint(velocity=np.linspace(-0.5, 0.5, N))
    result = made_up.past_validation(joint, with_value(LOAD, 2, NAN))
    expected = made_up.controller.first.robot.gravity(joint.position) - 2.0 * joint.velocity
    np.testing.assert_allclose(result.record.wanted[:N], expected, atol=ROUNDING)
    np.testing.assert_allclose(result.command.effort, expected, atol=1.0)  # as fast as the rate limit lets it


@pytest.mark.parametrize(
    ("name", "value"), [("position", NAN), ("rotation", INF), ("twist", NAN), ("acceleration", -INF)]
)
def test_a_reference_that_is_not_finite_is_not_followed(name: str, value: float) -> None:
    made_up = law_at_work()
    parts = {"position": np.zeros(3), "rotation": np.eye(3), "twist": ZERO, "acceleration": ZERO}
    bad = with_value(parts[name].ravel(), 2, value).reshape(parts[name].shape)
    made_up.session.set_reference(CartesianReference(**{**parts, name: bad}))
    result = made_up.cycle()
    inside(made_up, result)
    assert (result.mode, result.reason) == (Mode.HOLD, "reference is not finite")


def test_a_reference_that_no_arm_can_follow_is_refused_and_nothing_changes() -> None:
    made_up, twin = law_at_work(), law_at_work()
    made_up.cycle(), twin.cycle()
    wild = with_value(ZERO, 2, 1e200)
    with pytest.raises(InputError, match=r"^reference: acceleration: got 1e\+200, expected at most 10000"):
        made_up.session.set_reference(CartesianReference(np.zeros(3), np.eye(3), ZERO, wild))
    after = made_up.cycle()
    assert after.mode == Mode.ACTIVE
    assert after.command.effort.tobytes() == twin.cycle().command.effort.tobytes()


def test_stamps_that_are_wrong_are_bridged_and_then_gravity_of_the_last_good_position_is_left() -> None:
    """Then nothing tells where the model has the arm: for how long it has moved is not known."""
    made_up = law_at_work()
    good = made_up.run(20)
    bridge_ns = round(made_up.controller.first.params.safety.inputs.bridge_s * 1e9)

    def cycle() -> CycleResult:
        made_up.pass_time()
        old = JointSample(good.joint.stamp_ns, POSITION, VELOCITY, np.zeros(N))
        made_up.session.add_joint(old, made_up.now_ns)
        made_up.session.give(old, [WrenchSample(made_up.stamp_ns, LOAD)], [None], [])
        fault = Fault.OUT_OF_ORDER
        return made_up.session.answer(old, fault, made_up.now_ns, 0, Health(joint=fault))

    for passed in range(0, bridge_ns + 1, MS):
        bad = cycle()
        assert bad.command.effort.tobytes() == good.command.effort.tobytes()
        assert bad.mode == Mode.ACTIVE, passed
    for _ in range(100):
        bad = cycle()
    assert (bad.mode, bad.reason) == (Mode.HOLD, "joint state is out of order")
    expected = made_up.controller.first.robot.gravity(good.joint.position)
    np.testing.assert_allclose(bad.command.effort, expected, atol=ROUNDING)
    assert not bad.ok


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


def test_a_cycle_is_a_function_of_state_and_inputs() -> None:
    """Same bytes, same bytes, whatever was computed in between."""
    made_up = law_at_work(slip_estimator="observer", **SLOW)
    before = made_up.session.buffer.copy()
    result = made_up.run(1)
    state, outputs = made_up.session.buffer.copy(), result.outputs.copy()
    made_up.run(5, joint={"position": POSITION + 0.3})
    waiting = before.copy()
    begun = law_at_work(slip_estimator="observer", **SLOW)
    begun.session.restore(waiting)
    begun.stamp_ns, begun.now_ns, begun.tick = STAMP_NS, 5_000_000_000, made_up.tick - 6
    again = begun.run(1)
    assert again.outputs.tobytes() == outputs.tobytes()
    assert begun.session.buffer.tobytes() == state.tobytes()


def test_the_same_buffers_give_the_same_bytes() -> None:
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


def test_results_stay_as_they_are_when_the_controller_goes_on() -> None:
    made_up = law_at_work()
    first = made_up.run(1)
    seen = first.outputs.tobytes(), first.inputs.tobytes(), first.command.effort.tobytes(), first.scalars()
    made_up.run(3, slip=10 * SLIP)
    assert (first.outputs.tobytes(), first.inputs.tobytes(), first.command.effort.tobytes()) == seen[:3]
    assert first.scalars() == seen[3]


# -- what the law is given ----------------------------------------------------------------------------


def test_slip_displacement_is_integrated_over_cycles() -> None:
    """0.2 s at a constant slip twist, with cycles of 1, 2 and 3 ms: the displacement is the exponential's."""
    twist = np.array([0.02, -0.01, 0.0, 0.0, 0.0, 0.9])
    made_up = law_at_work()
    for k in range(100):
        made_up.past_validation(made_up.joint(velocity=np.zeros(N)), slip=twist, passed_ns=(1 + k % 3) * MS)
    t, slip = (made_up.stamp_ns - STAMP_NS) * 1e-9, made_up.state.law.slips[0]
    angle = twist[5] * t
    V = np.array([[np.sin(angle), np.cos(angle) - 1.0], [1.0 - np.cos(angle), np.sin(angle)]]) / angle
    np.testing.assert_allclose(slip.rotation, exponential(twist[3:] * t), atol=1e-8)
    np.testing.assert_allclose(slip.position[:2], V @ twist[:2] * t, atol=1e-8)


def test_slip_outside_of_the_slip_axes_is_not_used() -> None:
    axes = {"contacts__slip_axes": (True, True, False, False, False, True)}
    efforts = []
    for odd in (0.0, 0.3):
        made_up = law_at_work(**axes)
        slip = SLIP + odd * np.array([0.0, 0.0, 1.0, 1.0, 1.0, 0.0])
        efforts.append(made_up.past_validation(slip=slip).record.law.effort.tobytes())
    assert efforts[0] == efforts[1]


def test_a_dead_band_takes_small_slip_speeds_for_none() -> None:
    for band, expected in ((0.0, SLIP[:2]), (0.01, np.zeros(2))):
        made_up = law_at_work(measured__dead_band_linear=band)
        v_s = made_up.past_validation(slip=SLIP).record.law.v_s
        np.testing.assert_allclose(v_s[:2], expected, atol=ROUNDING)


def test_the_law_is_given_the_observer_s_estimate() -> None:
    """Not the newest sample: an estimate of both, on the axes in which the contact can slip."""
    made_up = law_at_work(slip_estimator="observer", **SLOW)
    slid = 0
    for k in range(60):
        shown = SLIP * (1.0 + 0.3 * (-1) ** k) if k > 10 else ZERO
        record_, observer = made_up.past_validation(slip=shown).record, made_up.state.observer
        np.testing.assert_array_equal(record_.samples[0].slip_twist, observer.twist)
        np.testing.assert_array_equal(record_.law.v_s, observer.twist)
        np.testing.assert_array_equal(record_.follow_error, observer.error)
        np.testing.assert_array_equal(observer.v_ee, made_up.session.newest_joint is not None and record_.motion.v_ee)
        slid += bool(np.abs(observer.twist).max() > 0.0 and not np.array_equal(observer.twist, shown))
    assert slid > 20
    assert observer.sliding


def test_without_slip_samples_the_observer_goes_on_with_the_model_alone() -> None:
    """What is said of an unknown slip velocity is no sample: neither the last one nor zero."""
    found = []
    for shown in (SLIP, 50 * SLIP):
        made_up = law_at_work(slip_estimator="observer", **SLOW)
        made_up.run(20)
        for _ in range(3):
            result = made_up.past_validation(slip=shown, health=Health(slip=Fault.INVALID))
        assert result.mode == Mode.DEGRADED
        assert result.reason == "slip velocity is invalid: predicting it from the wrench"
        found.append(made_up.state.observer.tobytes())
    assert found[0] == found[1]


def test_feed_forward_can_be_switched_off() -> None:
    for on in (True, False):
        made_up = law_at_work(feed_forward=on, **QUINTIC)
        a_d = made_up.run(200).record.law.a_d
        assert (a_d[0] > 0.1) == on
        assert on or not a_d.any()


def test_at_rest_on_the_reference_the_torque_is_gravity_and_load() -> None:
    made_up = MadeUp()
    result = made_up.cycle(made_up.joint(velocity=np.zeros(N)), slip=ZERO, passed_ns=0)
    gravity, J = made_up.controller.first.robot.gravity(result.joint.position), result.arm.J[:, :N]
    np.testing.assert_allclose(
        result.record.law.effort[:N], gravity - J.T @ result.record.law.torque.h_ee, atol=ROUNDING
    )


# -- references ---------------------------------------------------------------------------------------


def test_the_trajectory_starts_at_its_time_from_the_first_pose() -> None:
    made_up = law_at_work(**QUINTIC, trajectory__start_s=0.5)
    start = np.array(made_up.state.law.start_position)
    expected = {500: 0.0, 1000: 0.05, 1500: 0.1, 3000: 0.1}
    for ms in range(10, 3001, 10):
        result = made_up.past_validation(passed_ns=10 * MS)
        moved = result.record.reference.position - start
        if ms in expected:
            np.testing.assert_allclose(moved, [expected[ms], 0.0, 0.0], atol=ROUNDING)
        assert result.path_speed == 1.0


def test_a_given_reference_replaces_the_trajectory() -> None:
    made_up = law_at_work()
    law = made_up.state.law
    turned = exponential(np.array([0.0, 0.0, 0.2])) @ law.start_rotation
    twist = np.array([0.0, 0.1, 0.0, 0.0, 0.0, 0.2])
    made_up.session.set_reference(CartesianReference(law.start_position + 0.1, turned, twist, 0.5 * twist))
    result = made_up.run(1, joint={"velocity": np.zeros(N)})
    np.testing.assert_allclose(result.record.law.e, [-0.1, -0.1, -0.1, 0.0, 0.0, -0.2], atol=1e-5)
    np.testing.assert_array_equal(result.record.reference.twist, twist)
    np.testing.assert_array_equal(result.record.reference.acceleration, 0.5 * twist)


# -- what is published --------------------------------------------------------------------------------


def test_saturation_is_flagged_per_joint() -> None:
    made_up = law_at_work()
    result = made_up.past_validation(wrench=np.array([0.0, 0.0, 300.0, 0.0, 0.0, 0.0]), slip=ZERO)
    law, limit = result.record.law, made_up.controller.first.robot.effort_limit
    beyond = np.abs(law.torque.tau[:N]) > limit
    np.testing.assert_array_equal(law.saturated[:N], beyond)
    assert beyond.any()
    assert not beyond.all()
    np.testing.assert_allclose(law.effort[:N], np.clip(law.torque.tau[:N], -limit, limit), atol=ROUNDING)
    assert (result.record.saturated[:N] >= beyond).all()


def test_scalars_have_the_same_names_in_every_cycle() -> None:
    made_up = law_at_work()
    good = made_up.run(1).scalars()
    safe = made_up.past_validation(wrench=np.full(6, NAN)).scalars()
    assert list(good) == list(safe)
    assert all(isinstance(value, float) for value in (*good.values(), *safe.values()))
    assert np.isfinite(list(good.values())).all()
    assert np.isnan(safe["gate"])
    assert (safe["safe"], good["safe"]) == (1.0, 0.0)
    assert good["v_s_x"] != 0.0
    assert good["K_x"] < 5.0
    assert 0.0 < good["gate"] < 1.0


def test_the_posture_is_the_first_that_is_measured_or_the_parameter() -> None:
    made_up = law_at_work()
    np.testing.assert_allclose(made_up.state.law.posture[:N], POSITION, atol=1e-6)
    posed = law_at_work(nullspace__posture=(0.1,) * N)
    np.testing.assert_array_equal(posed.state.law.posture[:N], 0.1)


def test_a_singular_posture_is_reported_and_bounded() -> None:
    made_up = MadeUp()
    result = made_up.cycle(made_up.joint(np.zeros(N), np.zeros(N)), slip=ZERO, passed_ns=0)
    assert result.scalars()["near_singular_arm"] == 1.0
    inside(made_up, result)


def test_k_s_is_what_the_delays_allow() -> None:
    """Slip samples every 10 ms, 5 ms old: k_s 1000 /s would swing. A controller whose k_s is fixed keeps it."""
    for mode, lowered in (("auto", True), ("fixed", False)):
        made_up = law_at_work(gains__k_s=400.0, gains__k_s_mode=mode)
        for k in range(40):
            made_up.pass_time()
            if k % 10 == 0:
                made_up.session.add_slip(
                    0, SlipSample(made_up.stamp_ns - 5 * MS, SLIP * (1.0 + 0.01 * k)), made_up.now_ns
                )
            made_up.deliver(slip=None)
            made_up.session.add_joint(made_up.joint(), made_up.now_ns)
            k_s = made_up.session.cycle(made_up.now_ns).record.gains.gains.k_s
        law = made_up.state.law
        assert (k_s < 399.0) == lowered
        if lowered:
            assert (law.held, law.late) == (10, 5)
            assert k_s == pytest.approx(held_sample_limit(10, 5) / 0.001 / 2.0)


def test_numbers_of_the_ledger() -> None:
    """Cycle, stamps of what was used, clock, mode, health and request: all that a replay needs."""
    made_up = law_at_work()
    result = made_up.run(1)
    sec, nanosec = divmod(made_up.stamp_ns, 10**9)
    assert result.ledger == (1, sec, nanosec, sec, nanosec, sec, nanosec)
    assert result.decision == (*divmod(made_up.now_ns, 10**9), Mode.ACTIVE, 0, 0)
    made_up.session.set_publishers({"wrench": 2}, 1)
    bad = made_up.run(1, slip=np.full(6, NAN))
    assert Health.from_code(bad.decision[3]) == Health(Fault.NONE, Fault.NONE, Fault.INVALID, Fault.SECOND_PUBLISHER)
    assert bad.decision[2] == Mode.HOLD
    assert bad.cycle == 2


def test_what_arms_show_together_at_rest_is_a_share_of_what_lies_beyond_the_weight() -> None:
    """What they press on each other cancels; it is known once all hold, and all wrenches have been measured."""
    rng, n = np.random.default_rng(8), 3
    configs, states, inputs = (
        records(np.zeros((n, layout.itemsize // 8)), layout) for layout in (CONFIG, ARM_STATE, INPUTS)
    )
    share, beyond, inner = np.array([0.1, -0.2, -2.0]), rng.normal(size=3), rng.normal(size=(n, 3))
    inner -= inner.mean(axis=0)
    first = configs[0]
    first.tare.duration_ns = 1
    for k in range(n):
        R = exponential(rng.normal(size=3))
        configs[k].wrench_sensor.as_is, configs[k].hold.weight = 1, share
        states[k].mode.mode, states[k].wrench_inputs[0].seen = Mode.HOLD, 1
        states[k].wrench_inputs[0].values[:3] = R.T @ (share + beyond + inner[k])
        inputs[k].arm.rotation = R
    found = call(all_at_rest, configs, states, inputs)
    assert (found.arms, found.known) == (n, True)
    np.testing.assert_allclose(found.beyond, beyond, atol=ROUNDING)
    states[0].tare.done = states[2].tare.done = 1
    assert call(all_at_rest, configs, states, inputs).known, "of one it is still wanted"
    states[1].tare.done = 1
    assert not call(all_at_rest, configs, states, inputs).known
    for k in range(n):
        for state in states:
            state.tare.done = 0
        states[k].mode.mode = Mode.ACTIVE
        assert not call(all_at_rest, configs, states, inputs).known
        states[k].mode.mode, states[k].wrench_inputs[0].seen = Mode.HOLD, 0
        assert not call(all_at_rest, configs, states, inputs).known
        states[k].wrench_inputs[0].seen = 1
    assert not call(all_at_rest, configs[:1], states[:1], inputs[:1]).known, "a single arm has its own wrench"
    first.tare.duration_ns = 0
    assert not call(all_at_rest, configs, states, inputs).known


def test_kappa_is_no_more_than_the_oldest_wrench_and_the_drives_lag_allow() -> None:
    config, state, outputs = (record(new(of), of) for of in (CONFIG, ARM_STATE, OUTPUTS))
    config.law.contacts, config.cycle.period_ns, config.cycle.pad_stiffness = 2, MS, 1e4
    outputs.gains.gains.M_D[:3] = 2.0, 1.0, 3.0
    for share, lag_s, measured_ms, late_ms, kappa in itertools.product(
        (0.5, 1.0), (0.0, 0.003), (0, 2), ((0, 0), (1, 5), (5, 1)), (0.05, 1e3)
    ):
        config.cycle.kappa_share, config.cycle.drive_lag_s = share, lag_s
        state.latency.most_ns, state.joint.answers.stamp_ns, outputs.gains.gains.kappa = measured_ms * MS, 9 * MS, kappa
        for k in range(2):
            state.wrench_inputs[k].stamp_ns = (9 - late_ms[k]) * MS
        call(limit_internal_gain, config, state, outputs)
        most = share * internal_gain_limit(1.0, 1e4, lag_s + 1e-3 * (1 + measured_ms + max(late_ms)))
        assert outputs.gains.gains.kappa == pytest.approx(min(kappa, most))


def test_the_laws_of_several_arms_begin_together_and_wait_for_one_that_is_not_answered() -> None:
    """Whatever lets one begin lets all; the one whose joint states have restarted is left to its own restart."""
    for begun, known, absent, restarts, after, alone in (
        (1, (1, 1, 1), None, None, (1, 1, 1), False), (0, (1, 1, 1), None, None, (0, 0, 0), False),
        (1, (1, 0, 1), None, None, (0, 0, 0), False), (1, (1, 1, 1), None, 1, (0, 1, 0), False),
        (1, (1, 1, 1), 2, None, (1, 1, 1), True), (1, (1, 0, 1), 2, None, (1, 0, 1), True),
        (1, (1, 1, 1), 2, 2, (1, 1, 1), True), (1, (1, 1, 1), 2, 0, (1, 1, 1), True),
        (1, (1, 0), None, None, (0, 0), False),
    ):  # fmt: skip
        n = len(known)
        states, inputs = (records(np.zeros((n, layout.itemsize // 8)), layout) for layout in (ARM_STATE, INPUTS))
        task = record(new(TASK_STATE), TASK_STATE)
        task.begun = begun
        for k in range(n):
            states[k].law.known, inputs[k].present = known[k], k != absent
            states[k].joint.pending_fault = Fault.RESTARTED if k == restarts else Fault.NONE
        case = begun, known, absent, restarts
        assert call(begin_together, task, states, inputs) == alone, case
        assert tuple(state.law.known for state in states) == after, case
        begins = not begun or 0 in known or (restarts is not None and restarts != absent)
        assert task.begun == (0 if begins else begun), case
        states[0].law.known, task.begun = 1, 0
        call(begin_together, task, states[:1], inputs[:1])
        assert states[0].law.known == 1, "one arm alone waits for nobody"
