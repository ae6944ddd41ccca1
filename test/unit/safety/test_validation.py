"""Input validation: what is wrong with a sample and with an input."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.records import record
from slip_core.types import JointSample, SlipSample
from slip_sim_bridge.sensors.slip import SlipMeasurement
from slip_vic.presets import preset_names
from slip_vic.presets.models import load_sensor
from slip_vic_controller.params.safety_params import SafetyParams
from slip_vic_controller.safety.faults import WORDS, Fault, Input, describe_fault
from slip_vic_controller.safety.validation import ACCEPT_AFTER, JUMP, vector_validity
from slip_vic_controller.session.arrival import receive_joint_state, receive_slip, receive_wrench
from slip_vic_controller.sizes import MAX_FRESH
from slip_vic_controller.state import ARM_SIZE, ARM_STATE, CONFIG, TASK_SIZE
from test.support.call import call
from test.support.made_up import MS, NOW_NS, POSITION, STAMP_NS, MadeUp, N, controller_of

INPUTS = SafetyParams().inputs
WRENCH, SLIP = INPUTS.wrench, INPUTS.slip
AGE_NS = round(SLIP.age_s * 1e9)
PERIOD_NS = 4 * MS
SLIP_AXES = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])
QUIET = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])


class Validation:
    """The inputs of one arm; joint states with efforts of zero."""

    def __init__(self, lockstep: bool = False, quantum: float = 0.0) -> None:
        controller = controller_of(lockstep, slip_sensor__quantum_linear=quantum)
        self.config, self.lockstep = controller.config, lockstep
        self.buffer = controller.new_state()[TASK_SIZE:][:ARM_SIZE]
        self.state = record(self.buffer, ARM_STATE)

    def joint(self, stamp_ns: int, q, qd, now_ns: int) -> Fault:
        q, qd = np.array(q, dtype=float), np.array(qd, dtype=float)
        args = (stamp_ns, q, qd, np.zeros(N), False, now_ns, self.lockstep)
        return Fault(receive_joint_state(self.config, self.buffer, *args))

    def vector(self, is_slip: bool, stamp_ns: int, values, now_ns: int) -> Fault:
        values = np.array(values, dtype=float)
        if is_slip:
            return Fault(receive_slip(self.config, self.buffer, 0, stamp_ns, values, True, False, now_ns))
        return Fault(receive_wrench(self.config, self.buffer, 0, stamp_ns, values, False, now_ns))

    def validity(self, is_slip: bool, now_ns: int, joint_stamp_ns: int, arm_moves: bool = False) -> Fault:
        config, state = record(self.config, CONFIG), record(self.buffer, ARM_STATE)
        limits, vector = (config.slip, state.slip_inputs) if is_slip else (config.wrench, state.wrench_inputs)
        return Fault(call(vector_validity, limits, vector[0], now_ns, joint_stamp_ns, arm_moves))


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"q": np.nan}, Fault.NOT_FINITE), ({"qd": np.inf}, Fault.NOT_FINITE), ({"q": 10.0}, Fault.ABSURD),
        ({"qd": 1e3}, Fault.ABSURD), ({"qd": 1e-310}, Fault.DENORMAL), ({"stamp_ns": -MS}, Fault.OUT_OF_ORDER),
        ({"stamp_ns": 0}, Fault.DUPLICATE), ({"stamp_ns": 10**9}, Fault.CLOCK_JUMP), ({"q": 0.3}, Fault.JUMP),
        ({}, Fault.NONE),
    ],
)  # fmt: skip
def test_joint_state_faults(change: dict[str, float], fault: Fault) -> None:
    v = begun()
    stamp_ns, now_ns = at(5)
    if "stamp_ns" in change:
        stamp_ns = at(4)[0] + int(change["stamp_ns"])
    one = np.arange(N) == 2
    q = POSITION + 1e-6 + np.where(one, change.get("q", 0.0), 0.0)
    qd = np.where(one, change.get("qd", 0.0), 0.0)
    assert v.joint(stamp_ns, q, qd, now_ns) == fault
    assert v.state.joint.counts[fault] == (0 if fault == Fault.NONE else 1)
    kept = fault in (Fault.NONE, Fault.DENORMAL)
    assert v.state.joint.last.stamp_ns == (stamp_ns if kept else at(4)[0])


@pytest.mark.parametrize("is_slip", [False, True])
def test_vector_faults(is_slip: bool) -> None:
    largest = SLIP.angular if is_slip else WRENCH.torque
    for values, shift_ns, fault in (
        (np.nan, 0, Fault.NOT_FINITE), (1.01 * largest, 0, Fault.ABSURD), (1e-310, 0, Fault.DENORMAL),
        (1.0, -2 * PERIOD_NS, Fault.OUT_OF_ORDER), (1.0, -PERIOD_NS, Fault.DUPLICATE), (1.0, 10**9, Fault.FUTURE),
        (0.99 * largest, 0, Fault.NONE),
    ):  # fmt: skip
        v = begun()
        v.vector(is_slip, at(4)[0], QUIET, at(4)[1])
        given = np.where(np.arange(6) == 4, values, 0.01)
        assert v.vector(is_slip, at(5)[0] + shift_ns, given, at(5)[1]) == fault, values
    invalid = receive_slip(v.config, v.buffer, 0, at(6)[0], QUIET, False, False, at(6)[1])
    assert invalid == Fault.INVALID


def test_one_velocity_that_no_effort_has_made_is_replaced_and_the_next_one_counts() -> None:
    v, q, spike = Validation(), POSITION.copy(), 20.0 * (np.arange(N) == 3) / 10.0
    used = []
    for k, qd in enumerate((0.1, 0.1 + spike, 0.1, 0.1 + spike, 0.1 + spike, 0.1 + spike, 0.1, 0.1)):
        q = q + 1e-3 * np.where((k in (5, 6)) & (spike > 0.0), 2.1, 0.1)  # thrown in the fourth, caught in the sixth
        assert v.joint(STAMP_NS + k * MS, q, np.broadcast_to(qd, N), NOW_NS + k * MS) == Fault.NONE
        used.append(float(v.state.joint.last.velocity[3]))
    np.testing.assert_allclose(used, [0.1, 0.1, 0.1, 0.1, 2.1, 2.1, 2.1, 0.1], atol=1e-9)
    assert v.state.joint.last.velocity[:N].max() == 0.1


def test_one_position_that_no_velocity_explains_is_replaced_and_the_next_one_counts() -> None:
    v, qd, way = Validation(), np.full(N, 0.1), 0.1e-3 * np.arange(8)
    off = 0.02 * (np.arange(N) == 3)
    for k, wrong in enumerate((0.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0, 0.0)):
        assert v.joint(STAMP_NS + k * MS, POSITION + way[k] + wrong * off, qd, NOW_NS + k * MS) == Fault.NONE
        jumped = (k > 3 and wrong > 0.0) or k == 7  # for good in the fourth, and back in the eighth
        expected = way[k] + (0.02 if jumped else 0.0)
        assert v.state.joint.last.position[3] - POSITION[3] == pytest.approx(expected, abs=1e-9)
    np.testing.assert_allclose(v.state.joint.last.position[:3], POSITION[:3] + way[7], atol=1e-12)


def test_velocities_that_no_joint_state_has_are_those_of_the_positions() -> None:
    v, nothing, way = Validation(), np.full(N, np.nan), np.array([0.0, 1.0, 3.0, 3.0, 3.0, 6.0]) * 1e-3
    shown = []
    for k, done in enumerate(way):
        assert v.joint(STAMP_NS + k * MS, POSITION + done, nothing, NOW_NS + k * MS) == Fault.NONE
        shown.append(float(v.state.joint.last.velocity[0]))
    np.testing.assert_allclose(shown, [0.0, 1.0, 2.0, 2.0, 2.0, 1.0], rtol=1e-9)  # sent three times, over three periods
    assert v.joint(STAMP_NS + 6 * MS, POSITION + 0.007, np.full(N, 0.5), NOW_NS + 6 * MS) == Fault.NONE
    assert v.joint(STAMP_NS + 7 * MS, POSITION + 0.007, nothing, NOW_NS + 7 * MS) == Fault.NOT_FINITE


def test_positions_that_are_sent_again_show_the_way_of_that_time_in_one_step() -> None:
    v, qd = Validation(), np.full(N, 2.0)
    for k in range(12):
        q = POSITION + 2e-3 * 4 * (k // 4)  # 8 mrad
        v.joint(STAMP_NS + k * MS, q, qd, NOW_NS + k * MS)
        assert v.state.joint.last.position[0] == q[0]


def test_a_velocity_may_change_by_more_after_a_pause() -> None:
    v, q = Validation(), POSITION.copy()
    v.joint(STAMP_NS, q, np.zeros(N), NOW_NS)
    v.joint(STAMP_NS + 20 * MS, q, np.full(N, 2.0), NOW_NS + 20 * MS)
    assert v.state.joint.last.velocity[:N].min() == 2.0


# -- joint states -------------------------------------------------------------------------------------


def begun() -> Validation:
    v = Validation()
    for k in range(5):
        assert v.joint(STAMP_NS + k * PERIOD_NS, POSITION + 1e-6 * k, np.zeros(N), NOW_NS + k * PERIOD_NS) == Fault.NONE
    return v


def at(k: int) -> tuple[int, int]:
    return STAMP_NS + k * PERIOD_NS, NOW_NS + k * PERIOD_NS


def test_samples_that_agree_after_a_jump_are_a_restart() -> None:
    """Only the last of them, and only of those that follow each other; then the next jump begins anew."""
    v, jumped = begun(), POSITION + 0.3
    for k in range(5, 5 + ACCEPT_AFTER - 1):
        assert v.joint(at(k)[0], jumped + 1e-6 * k, np.zeros(N), at(k)[1]) == Fault.JUMP
    k += 1
    assert v.joint(at(k)[0], jumped - 0.6, np.zeros(N), at(k)[1]) == Fault.JUMP  # does not agree: the first of others
    for k in range(5 + ACCEPT_AFTER, 3 + 2 * ACCEPT_AFTER):
        assert v.joint(at(k)[0], jumped - 0.6 + 1e-6 * k, np.zeros(N), at(k)[1]) == Fault.JUMP
    k += 1
    assert v.joint(at(k)[0], jumped - 0.6, np.zeros(N), at(k)[1]) == Fault.RESTARTED
    assert v.joint(at(k + 1)[0], jumped - 0.6 + 1e-6, np.zeros(N), at(k + 1)[1]) == Fault.NONE
    # After a restart nothing of the jump before is left.
    for k in range(5 + 2 * ACCEPT_AFTER, 4 + 3 * ACCEPT_AFTER):
        assert v.joint(at(k)[0], POSITION + 1e-6 * k, np.zeros(N), at(k)[1]) == Fault.JUMP
    assert v.joint(at(k + 1)[0], POSITION, np.zeros(N), at(k + 1)[1]) == Fault.RESTARTED


def test_a_good_sample_between_jumps_makes_them_forgotten() -> None:
    v, jumped = begun(), POSITION + 0.3
    for k in range(5, 30):
        good = k % (ACCEPT_AFTER - 1) == 0
        position = (POSITION if good else jumped) + 1e-6 * k
        assert v.joint(at(k)[0], position, np.zeros(N), at(k)[1]) == (Fault.NONE if good else Fault.JUMP)


@pytest.mark.parametrize("step_ns", [10**10, -(10**10)])
def test_a_clock_that_jumps_is_taken_up_where_every_sample_comes_twice(step_ns: int) -> None:
    v = begun()
    for k in range(5, 5 + ACCEPT_AFTER):
        expected = Fault.CLOCK_JUMP if k < 4 + ACCEPT_AFTER else Fault.RESTARTED
        for again in (0, 1):
            arrival_ns = at(k)[1] + again * MS // 10
            fault = v.joint(at(k)[0] + step_ns, POSITION + 1e-6 * k, np.zeros(N), arrival_ns)
            assert fault == (Fault.DUPLICATE if again and expected == Fault.RESTARTED else expected)


def test_in_lockstep_a_jump_is_a_restart_at_once() -> None:
    v = Validation(lockstep=True)
    assert v.joint(*(STAMP_NS, POSITION, np.zeros(N)), NOW_NS) == Fault.NONE
    assert v.joint(STAMP_NS + MS, POSITION + 0.3, np.zeros(N), NOW_NS + MS) == Fault.RESTARTED


def test_speed_explains_a_change_of_position_for_a_tenth_of_a_second() -> None:
    jump = JUMP
    for passed_s, speed, step, expected in (
        (0.004, 0.0, 0.9 * jump, Fault.NONE),
        (0.004, 0.0, 1.1 * jump, Fault.JUMP),
        (0.02, 2.0, jump + 0.9 * 2.0 * 0.04, Fault.NONE),
        (0.02, 2.0, jump + 1.1 * 2.0 * 0.04, Fault.JUMP),
        (0.5, 2.0, jump + 0.9 * 2.0 * 0.2, Fault.NONE),
        (0.045, 2.0, jump + 1.1 * 2.0 * 0.09, Fault.JUMP),
        (0.5, 2.0, jump + 1.1 * 2.0 * 0.2, Fault.RESTARTED),  # after a silence it is where the arm is,
    ):
        for sign in (1.0, -1.0):
            v, passed = begun(), round(passed_s * 1e9)
            moved = POSITION + sign * step * (np.arange(N) == 1)
            stamp, now = at(4)[0] + passed, at(4)[1] + passed
            assert v.joint(stamp, moved, np.full(N, sign * speed), now) == expected, (passed_s, speed, step)


def test_what_is_dropped_in_real_time_is_answered_in_lockstep() -> None:
    for lockstep in (False, True):
        for stamp, fault in ((STAMP_NS, Fault.DUPLICATE), (STAMP_NS - MS, Fault.OUT_OF_ORDER)):
            v = Validation(lockstep)
            v.joint(STAMP_NS, POSITION, np.zeros(N), NOW_NS)
            v.state.joint.pending = 0
            assert v.joint(stamp, POSITION, np.zeros(N), NOW_NS + MS) == fault
            assert v.state.joint.pending == lockstep


def test_the_newest_joint_state_wins_and_a_restart_is_not_forgotten() -> None:
    v = Validation(lockstep=True)
    v.joint(STAMP_NS, POSITION, np.zeros(N), NOW_NS)
    v.joint(STAMP_NS + MS, POSITION + 0.3, np.zeros(N), NOW_NS + MS)
    v.joint(STAMP_NS + 2 * MS, POSITION + 0.31, np.zeros(N), NOW_NS + 2 * MS)
    joint = v.state.joint
    assert (joint.skipped, joint.pending_fault, joint.answers.stamp_ns) == (2, Fault.RESTARTED, STAMP_NS + 2 * MS)
    v.joint(STAMP_NS + 3 * MS, np.full(N, np.nan), np.zeros(N), NOW_NS + 3 * MS)
    assert v.state.joint.pending_fault == Fault.NOT_FINITE


def test_a_restart_of_the_clock_forgets_what_is_ahead_of_it_and_not_that_it_was_seen() -> None:
    v = Validation(lockstep=True)
    v.joint(STAMP_NS, POSITION, np.zeros(N), NOW_NS)
    for is_slip in (False, True):
        v.vector(is_slip, STAMP_NS, np.ones(6), NOW_NS)
    for inputs in (v.state.wrench_inputs, v.state.slip_inputs):
        inputs[0].invalid = 1
    back = STAMP_NS - 10**10
    assert v.joint(back, POSITION, np.zeros(N), NOW_NS + MS) == Fault.RESTARTED
    for inputs in (v.state.wrench_inputs, v.state.slip_inputs):
        assert inputs[0].invalid == 0, "it was the sample of the old clock that was"
    for is_slip, inputs in ((False, v.state.wrench_inputs), (True, v.state.slip_inputs)):
        assert v.validity(is_slip, NOW_NS + MS, back) == Fault.NEVER_SEEN
        assert inputs[0].seen == 1
        assert v.vector(is_slip, back, np.ones(6), NOW_NS + MS) == Fault.NONE
        assert v.validity(is_slip, NOW_NS + MS, back) == Fault.NONE


# -- wrench and slip velocity -------------------------------------------------------------------------


def heard_once() -> Validation:
    v = Validation()
    assert v.vector(True, STAMP_NS, QUIET, NOW_NS) == Fault.NONE
    return v


def said_while(bad: np.ndarray, heard: bool) -> Fault:
    """Return why a slip velocity does not count that was good once, and then bad, or not heard, for long."""
    v, validities = heard_once(), []
    for passed in range(PERIOD_NS, 2 * AGE_NS, PERIOD_NS):
        if heard:
            v.vector(True, STAMP_NS + passed, bad, NOW_NS + passed)
        validities.append(v.validity(True, NOW_NS + passed, STAMP_NS + passed))
    assert validities[0] == Fault.NONE  # one bad sample is dropped, and the last good one used
    return validities[-1]


@pytest.mark.parametrize(
    ("bad", "fault"), [(np.full(6, 2.0 * SLIP.linear), Fault.ABSURD), (np.full(6, np.inf), Fault.NOT_FINITE)]
)
def test_an_input_whose_numbers_are_bad_is_not_called_silent(bad: np.ndarray, fault: Fault) -> None:
    assert said_while(bad, heard=True) == fault
    assert said_while(bad, heard=False) == Fault.SILENT


def test_bad_numbers_of_long_ago_are_no_excuse_for_silence() -> None:
    v = heard_once()
    v.vector(True, STAMP_NS + PERIOD_NS, np.full(6, np.inf), NOW_NS + PERIOD_NS)
    assert v.validity(True, NOW_NS + 2 * AGE_NS, STAMP_NS + 2 * AGE_NS) == Fault.SILENT


def test_good_numbers_after_bad_ones_count_at_once() -> None:
    v, late = heard_once(), 2 * AGE_NS
    v.vector(True, STAMP_NS + late, np.full(6, np.inf), NOW_NS + late)
    assert v.validity(True, NOW_NS + late, STAMP_NS + late) == Fault.NOT_FINITE
    v.vector(True, STAMP_NS + late + PERIOD_NS, 2.0 * QUIET, NOW_NS + late + PERIOD_NS)
    assert v.validity(True, NOW_NS + late + PERIOD_NS, STAMP_NS + late + PERIOD_NS) == Fault.NONE


def test_one_sample_ahead_is_its_own_fault_and_two_are_not() -> None:
    v = Validation()
    v.joint(STAMP_NS, POSITION, np.zeros(N), NOW_NS)
    v.vector(False, STAMP_NS, np.ones(6), NOW_NS)
    ahead = STAMP_NS + 10**9
    for expected in (Fault.NONE, Fault.FUTURE):
        assert v.vector(False, ahead, np.ones(6), NOW_NS) == Fault.FUTURE
        assert v.validity(False, NOW_NS, STAMP_NS) == expected
    v.vector(False, STAMP_NS + 1, np.ones(6), NOW_NS)
    assert v.validity(False, NOW_NS, STAMP_NS) == Fault.NONE


def test_a_wrench_of_zeros_counts_as_invalid_from_the_one_in_a_row_on_that_is_told() -> None:
    controller = controller_of(False, wrench__zero_after=3)
    state = controller.new_state()[TASK_SIZE:][:ARM_SIZE]

    def take(k: int, value: float) -> Fault:
        later = k * PERIOD_NS
        args = (0, STAMP_NS + later, np.full(6, value), False, NOW_NS + later)
        return Fault(receive_wrench(controller.config, state, *args))

    zeros = [take(k, 0.0) for k in range(5)]
    assert zeros == [Fault.NONE, Fault.NONE, Fault.INVALID, Fault.INVALID, Fault.INVALID]
    assert [take(5, 1.0), take(6, 0.0)] == [Fault.NONE, Fault.NONE]


def test_only_values_that_should_change_are_frozen() -> None:
    """A wrench where the arm moves; a slip velocity that is not zero."""
    frozen_ns = round(INPUTS.frozen_s * 1e9) + 2 * PERIOD_NS
    for is_slip, values, moves, expected in (
        (False, np.ones(6), True, Fault.FROZEN),
        (False, np.ones(6), False, Fault.NONE),
        (True, np.ones(6), False, Fault.FROZEN),
        (True, np.zeros(6), True, Fault.NONE),
    ):
        v = Validation()
        for passed in range(0, frozen_ns, PERIOD_NS):
            v.vector(is_slip, STAMP_NS + passed, values, NOW_NS + passed)
        assert v.validity(is_slip, NOW_NS + passed, STAMP_NS + passed, moves) == expected
    v = Validation()
    for passed in range(0, frozen_ns, PERIOD_NS):  # a changed sign of zero is a change
        v.vector(
            False, STAMP_NS + passed, np.array([1.0, 0.0 if passed % (2 * PERIOD_NS) else -0.0, 0, 0, 0, 0]), NOW_NS
        )
    assert v.validity(False, NOW_NS, STAMP_NS + passed, True) == Fault.NONE


def test_no_sensor_that_works_is_frozen_and_one_that_does_not_work_is() -> None:
    """A slip of constant speed, read by every preset: one with a quantum repeats its readings, and may."""
    for name in preset_names("sensors"):
        params = load_sensor(name).slip
        period_ns = round(1e9 / params.rate_hz) if params.rate_hz else MS
        for seed in range(2):
            for speed in (0.00285, 0.02):
                rng = np.random.default_rng(seed)
                sensor = SlipMeasurement(params, SLIP_AXES, lambda rng=rng: rng)
                v = Validation(quantum=params.quantum_linear)
                for stamp_ns in range(STAMP_NS, STAMP_NS + 300 * MS, period_ns):
                    truth = speed * SLIP_AXES * (1.0 + 1e-6 * rng.random())
                    v.vector(True, stamp_ns, sensor(SlipSample(stamp_ns, truth), rng).twist, stamp_ns)
                    assert v.validity(True, stamp_ns, stamp_ns) == Fault.NONE, (name, seed, speed)
        for stamp_ns in range(STAMP_NS + 10**9, STAMP_NS + 10**9 + 700 * MS, period_ns):
            v.vector(True, stamp_ns, QUIET, stamp_ns)
        assert v.validity(True, stamp_ns, stamp_ns) == Fault.FROZEN, name


def test_of_too_many_slip_samples_between_two_cycles_the_oldest_go() -> None:
    v = Validation()
    for k in range(MAX_FRESH + 3):
        v.vector(True, STAMP_NS + k, QUIET * (1 + k), NOW_NS)
    queue = v.state.queue
    assert queue.count == MAX_FRESH
    assert [int(s.stamp_ns) - STAMP_NS for s in queue.samples] == list(range(3, MAX_FRESH + 3))
    np.testing.assert_allclose([s.twist[0] for s in queue.samples], 0.01 * np.arange(4, MAX_FRESH + 4))


def test_a_bad_slip_sample_and_one_of_another_pad_are_not_taken_in() -> None:
    v = Validation()
    v.vector(True, STAMP_NS, QUIET, NOW_NS)
    v.vector(True, STAMP_NS + 1, QUIET * np.nan, NOW_NS)
    v.vector(True, STAMP_NS, QUIET, NOW_NS)
    receive_slip(v.config, v.buffer, 1, STAMP_NS + 2, QUIET, True, False, NOW_NS)
    assert v.state.queue.count == 1


# -- what a session says of it ------------------------------------------------------------------------


def test_rates_and_counts_of_the_inputs() -> None:
    made_up = MadeUp()
    made_up.cycle()
    assert made_up.session.rates() == {}
    for _ in range(300):
        made_up.cycle(passed_ns=2 * MS)
    rates = made_up.session.rates()
    assert set(rates) == {"joint_states", "wrench", "slip_velocity"}
    for period, jitter in rates.values():
        assert period == pytest.approx(0.002)
        assert jitter == pytest.approx(0.0, abs=1e-9)
    for k in range(300):
        made_up.cycle(passed_ns=(1 + 2 * (k % 2)) * MS)
    assert made_up.session.rates()["wrench"] == pytest.approx((0.002, 0.001), rel=0.1)
    made_up.pass_time()
    made_up.deliver(np.full(6, np.nan), None)
    made_up.deliver(np.full(6, np.nan), None)
    made_up.session.set_publishers({"wrench": 2, "slip_velocity": 1}, 1)
    made_up.session.set_publishers({"wrench": 2}, 1)
    made_up.session.set_publishers({}, 2)
    assert made_up.session.counts() == {
        "wrench not_finite": 2, "wrench second_publisher": 1, "effort command foreign_command": 1,
    }  # fmt: skip


def test_wrong_sizes_are_refused() -> None:
    made_up = MadeUp()
    made_up.cycle()
    made_up.deliver(np.zeros(5), np.zeros(7))
    before = made_up.state.joint.last.stamp_ns
    made_up.pass_time()
    made_up.session.add_joint(JointSample(made_up.stamp_ns, np.zeros(6), np.zeros(7), np.zeros(7)), made_up.now_ns)
    assert made_up.session.counts() == {"joint state refused": 1, "wrench refused": 1, "slip refused": 1}
    assert made_up.state.joint.last.stamp_ns == before


def test_every_fault_has_words() -> None:
    """A finding without words would be none."""
    assert set(WORDS) == set(Fault) - {Fault.NONE}
    assert all(describe_fault(of, fault) for fault in WORDS for of in Input)
    assert describe_fault(Input.ANY, Fault.NONE) == ""
