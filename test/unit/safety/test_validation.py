"""Input validation: what is wrong with a sample and with an input."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.records import record
from slip_vic_controller.params.controller_params import SafetyParams
from slip_vic_controller.safety.conditions import Reason
from slip_vic_controller.safety.validation import (
    ACCEPT_AFTER,
    JointInput,
    JointLimits,
    SlipQueue,
    VectorInput,
    VectorLimits,
    frozen,
    queue_slip,
    rebase_vector,
    vector_validity,
)
from slip_vic_controller.session.arrival import receive_joint_state, receive_slip, receive_wrench
from slip_vic_controller.sizes import ROOM
from slip_vic_controller.state import ARM_SIZE, ARM_STATE, CONFIG, TASK_SIZE
from test.support.call import blank, call
from test.support.made_up import MS, NOW_NS, POSITION, STAMP_NS, N, controller_of

INPUTS = SafetyParams().inputs
PERIOD_NS = 4 * MS
EFFORT = np.linspace(1.0, 2.0, N)
QUIET = np.array([0.01, 0.0, 0.0, 0.0, 0.0, 0.0])


class Validation:
    """The inputs of one arm."""

    def __init__(self, lockstep: bool = False, quantum: float = 0.0) -> None:
        controller = controller_of(lockstep, slip_sensor__quantum_linear=quantum)
        self.config, self.lockstep = controller.config, lockstep
        self.buffer = controller.new_state()[TASK_SIZE:][:ARM_SIZE]
        self.state = record(self.buffer, ARM_STATE)

    def joint(self, stamp_ns: int, q, qd, now_ns: int, refused: bool = False) -> Reason:
        q, qd = np.array(q, dtype=float), np.array(qd, dtype=float)
        args = (stamp_ns, q, qd, EFFORT, refused, now_ns, self.lockstep)
        return Reason(receive_joint_state(self.config, self.buffer, *args))

    def vector(self, is_slip: bool, stamp_ns: int, values, now_ns: int) -> Reason:
        values = np.array(values, dtype=float)
        if is_slip:
            return Reason(receive_slip(self.config, self.buffer, 0, stamp_ns, values, True, False, now_ns))
        return Reason(receive_wrench(self.config, self.buffer, 0, stamp_ns, values, False, now_ns))

    def validity(self, is_slip: bool, now_ns: int, joint_stamp_ns: int, arm_moves: bool = False) -> Reason:
        config, state = record(self.config, CONFIG), record(self.buffer, ARM_STATE)
        limits, vector = (config.slip, state.slip_inputs) if is_slip else (config.wrench, state.wrench_inputs)
        return Reason(call(vector_validity, limits, vector[0], now_ns, joint_stamp_ns, arm_moves))


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"q": np.nan}, Reason.NOT_FINITE), ({"qd": np.inf}, Reason.NOT_FINITE), ({"q": 10.0}, Reason.ABSURD),
        ({"qd": 1e3}, Reason.ABSURD), ({"stamp_ns": -MS}, Reason.OUT_OF_ORDER),
        ({"stamp_ns": 0}, Reason.OUT_OF_ORDER), ({"q": 0.3}, Reason.JUMP), ({"stamp_ns": 204 * MS}, Reason.NONE),
        ({"stamp_ns": 204 * MS + 1}, Reason.CLOCK_JUMP), ({"stamp_ns": -200 * MS}, Reason.CLOCK_JUMP),
        ({"q": 0.3, "qd": 150.0}, Reason.NONE), ({"stamp_ns": 1 - 200 * MS}, Reason.OUT_OF_ORDER),
        ({"refused": 1.0}, Reason.REFUSED), ({}, Reason.NONE),
    ],
)  # fmt: skip
def test_joint_state_faults(change: dict[str, float], fault: Reason) -> None:
    v = begun()
    stamp_ns, now_ns = at(5)
    if "stamp_ns" in change:
        stamp_ns = at(4)[0] + int(change["stamp_ns"])
    one = np.arange(N) == 2
    q = POSITION + 1e-6 + np.where(one, change.get("q", 0.0), 0.0)
    qd = np.where(one, change.get("qd", 0.0), 0.0)
    assert v.joint(stamp_ns, q, qd, now_ns, "refused" in change) == fault
    assert v.state.joint.counts[fault] == (0 if fault == Reason.NONE else 1)
    kept = fault == Reason.NONE
    assert v.state.joint.last.stamp_ns == (stamp_ns if kept else at(4)[0])
    np.testing.assert_array_equal(v.state.joint.last.effort[:N], EFFORT)


@pytest.mark.parametrize("is_slip", [False, True])
def test_vector_faults(is_slip: bool) -> None:
    largest = (INPUTS.slip if is_slip else INPUTS.wrench)[1]
    ahead_ns = int(record(controller_of().config, CONFIG).slip.future_ns) - PERIOD_NS  # of the joint state before
    for values, shift_ns, fault in (
        (np.nan, 0, Reason.NOT_FINITE), (1.01 * largest, 0, Reason.ABSURD),
        (1.0, -2 * PERIOD_NS, Reason.OUT_OF_ORDER), (1.0, -PERIOD_NS, Reason.OUT_OF_ORDER),
        (1.0, ahead_ns, Reason.NONE), (1.0, ahead_ns + 1, Reason.FUTURE),
        (1.0, -STAMP_NS - 5 * PERIOD_NS, Reason.UNSTAMPED), (0.99 * largest, 0, Reason.NONE),
    ):  # fmt: skip
        v = begun()
        v.vector(is_slip, at(4)[0], QUIET, at(4)[1])
        given = np.where(np.arange(6) == 4, values, 0.01)
        of = (v.state.slip_inputs if is_slip else v.state.wrench_inputs)[0]
        for bad in (1, 2) if fault != Reason.NONE else (0,):
            assert v.vector(is_slip, at(5)[0] + shift_ns, given, at(5)[1]) == fault, values
            assert (of.bad, of.fault, of.fault_ns, of.counts[fault]) == (bad, fault, at(5)[1], bad)
    invalid = receive_slip(v.config, v.buffer, 0, at(6)[0], QUIET, False, False, at(6)[1])
    assert invalid == Reason.INVALID


def test_the_oldest_slip_samples_go() -> None:
    queue: SlipQueue = blank(SlipQueue)
    for k in range(ROOM + 2):
        queue_slip(queue, k, np.full(6, float(k)))
    assert [(one.stamp_ns, one.twist[5]) for one in queue.samples] == [(k, k) for k in range(2, ROOM + 2)]


# -- joint states -------------------------------------------------------------------------------------


def begun() -> Validation:
    v = Validation()
    for k in range(5):
        passed = k * PERIOD_NS
        assert v.joint(STAMP_NS + passed, POSITION + 1e-6 * k, np.zeros(N), NOW_NS + passed) == Reason.NONE
    return v


def at(k: int) -> tuple[int, int]:
    return STAMP_NS + k * PERIOD_NS, NOW_NS + k * PERIOD_NS


def test_an_arm_without_velocities_begins_at_rest() -> None:
    v, unmeasured = Validation(), np.full(N, np.nan)
    for k in (0, 1, 2):
        assert v.joint(at(k)[0], POSITION + 1e-4 * k, unmeasured, at(k)[1]) == Reason.NONE
        np.testing.assert_allclose(v.state.joint.last.velocity[:N], min(k, 1) * 1e-4 / 4e-3, rtol=1e-9)


def test_agreeing_samples_are_a_restart() -> None:
    """Only the last of them, and only of those that follow each other; then the next jump begins anew."""
    v, jumped = begun(), POSITION + 0.3
    for k in range(5, 5 + ACCEPT_AFTER - 1):
        assert v.joint(at(k)[0], jumped + 1e-6 * k, np.zeros(N), at(k)[1]) == Reason.JUMP
    k += 1
    assert v.joint(at(k)[0], jumped - 0.6, np.zeros(N), at(k)[1]) == Reason.JUMP  # does not agree: the first of others
    for k in range(5 + ACCEPT_AFTER, 3 + 2 * ACCEPT_AFTER):
        assert v.joint(at(k)[0], jumped - 0.6 + 1e-6 * k, np.zeros(N), at(k)[1]) == Reason.JUMP
    k += 1
    assert v.joint(at(k)[0], jumped - 0.6, np.zeros(N), at(k)[1]) == Reason.RESTARTED
    assert v.joint(at(k + 1)[0], jumped - 0.6 + 1e-6, np.zeros(N), at(k + 1)[1]) == Reason.NONE
    assert v.state.joint.pending_fault == Reason.RESTARTED, "the one before was not answered"
    # After a restart nothing of the jump before is left.
    for k in range(5 + 2 * ACCEPT_AFTER, 4 + 3 * ACCEPT_AFTER):
        assert v.joint(at(k)[0], POSITION + 1e-6 * k, np.zeros(N), at(k)[1]) == Reason.JUMP
    assert v.joint(at(k + 1)[0], POSITION, np.zeros(N), at(k + 1)[1]) == Reason.RESTARTED


# -- wrench and slip velocity -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("state", "now", "joint", "reason"),
    [
        ({}, 110, 110, Reason.NONE), ({}, 111, 110, Reason.SILENT), ({}, 110, 111, Reason.STALE),
        ({}, 100, 95, Reason.NONE), ({}, 100, 94, Reason.FUTURE), ({"known": 0}, 100, 100, Reason.SILENT),
        ({"fault": Reason.FUTURE, "bad": 1}, 100, 100, Reason.NONE),
        ({"fault": Reason.FUTURE, "bad": 2}, 100, 100, Reason.FUTURE), ({"equal_since_ns": 80}, 100, 100, Reason.NONE),
        ({"fault": Reason.INVALID}, 111, 100, Reason.INVALID), ({"equal_since_ns": 79}, 100, 100, Reason.FROZEN),
        ({"fault": Reason.ABSURD, "fault_ns": 101}, 111, 100, Reason.ABSURD),
        ({"fault": Reason.ABSURD, "fault_ns": 100}, 111, 100, Reason.SILENT),
        ({"fault": Reason.ABSURD, "fault_ns": 100}, 110, 100, Reason.NONE),
    ],
)  # fmt: skip
def test_each_limit_of_a_vector_on_both_sides(state: dict[str, int], now: int, joint: int, reason: Reason) -> None:
    """Of a slip velocity of ones with the stamp 100 that came at 100; bad numbers are not silence."""
    limits, of = blank(VectorLimits), blank(VectorInput)
    limits.age_ns, limits.frozen_ns, limits.future_ns, limits.zero_is_normal = 10, 20, 5, 1
    of.known, of.stamp_ns, of.arrival_ns, of.equal_since_ns, of.values[:] = 1, 100, 100, 100, 1.0
    for name, value in state.items():
        setattr(of, name, value)
    assert call(vector_validity, limits, of, now, joint, False) == reason


@pytest.mark.parametrize(("joint_ns", "left"), [(95, (1, Reason.ABSURD, 3)), (94, (0, Reason.NONE, 0))])
def test_a_sample_ahead_of_a_new_clock_is_forgotten(joint_ns: int, left: tuple[int, ...]) -> None:
    limits, of = blank(VectorLimits), blank(VectorInput)
    limits.future_ns, of.known, of.stamp_ns, of.fault, of.bad = 5, 1, 100, Reason.ABSURD, 3
    call(rebase_vector, limits, of, joint_ns)
    assert (of.known, of.fault, of.bad) == left


def test_joints_freeze_after_their_limit() -> None:
    limits, of = blank(JointLimits), blank(JointInput)
    limits.frozen_ns, of.equal_since_ns = 20, 80
    for of.known, now_ns, stays in ((1, 100, False), (1, 101, True), (0, 101, False)):
        assert bool(call(frozen, limits, of, now_ns)) is stays


def test_only_changing_values_can_freeze() -> None:
    """A wrench where the arm moves; a slip velocity that is not zero."""
    frozen_ns = round(INPUTS.frozen_s * 1e9) + 2 * PERIOD_NS
    for is_slip, values, moves, expected in (
        (False, np.ones(6), True, Reason.FROZEN),
        (False, np.ones(6), False, Reason.NONE),
        (True, np.ones(6), False, Reason.FROZEN),
        (True, np.zeros(6), True, Reason.NONE),
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
    assert v.validity(False, NOW_NS, STAMP_NS + passed, True) == Reason.NONE
