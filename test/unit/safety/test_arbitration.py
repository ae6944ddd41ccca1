"""Arbitration: what speaks against the law, in which order, and degradation levels by time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slip_core.records import new, record
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.arm.joint_estimate import Finding
from slip_vic_controller.safety.arbitration import HEALTH, Level, arbitrate
from slip_vic_controller.safety.faults import Fault, Input
from slip_vic_controller.safety.modes import Mode, TransitionReasons
from slip_vic_controller.safety.reasons import Cause, Reason, describe, of_fault, put_reason
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ARM_SIZE, ARM_STATE, CONFIG, TASK_SIZE, TASK_STATE
from test.support.call import call
from test.support.made_up import MS, NOW_NS, POSITION, N, controller_of

TWIST, STILL = np.zeros(6), np.zeros(N)
TIMES = ("slip_unknown_ns", "too_fast_ns", "saturated_ns", "stopping_ns")


class Memory(NamedTuple):
    """What arbitration has kept of earlier cycles; None where something does not last."""

    now_ns: int
    mode: Mode
    slip_unknown_ns: int | None
    too_fast_ns: int | None
    saturated_ns: int | None
    stopping_ns: int | None
    fall_speed: float
    slip_variance: np.ndarray
    path_speed: float
    path_scale: float
    reference_moves: bool
    unseen_ns: int
    frozen_before: bool
    wrench_bad_ns: int | None
    late_in_a_row: int
    pad_twist: np.ndarray
    slips: tuple[np.ndarray, ...]
    slid_before: bool


class Verdict(NamedTuple):
    fault: str
    hold: str
    degraded: str
    level: Level
    slip_unknown_ns: int | None
    too_fast_ns: int | None


QUIET = Memory(
    now_ns=NOW_NS - MS, mode=Mode.ACTIVE, slip_unknown_ns=None, too_fast_ns=None, saturated_ns=None, stopping_ns=None,
    fall_speed=0.0, slip_variance=TWIST, path_speed=1.0, path_scale=1.0, reference_moves=False,
    unseen_ns=0, frozen_before=False, wrench_bad_ns=None, late_in_a_row=0,
    pad_twist=TWIST, slips=(TWIST,), slid_before=False,
)  # fmt: skip
GOOD = (Fault.NONE, Fault.NONE, Fault.NONE)


class Arbitration:
    """Arbitration of one kind of controller."""

    def __init__(self, **values) -> None:
        self.controller = controller_of(**values)
        self.config, self.buffer = self.controller.config, self.controller.new_state()
        self.task = record(self.buffer[:TASK_SIZE], TASK_STATE)
        self.state = record(self.buffer[TASK_SIZE:][:ARM_SIZE], ARM_STATE)
        self.limits = record(self.config, CONFIG).arbitration
        self.names = self.controller.first.robot.joint_names

    def arbitrate(
        self, health, frozen: bool = False, q=POSITION, qd=STILL, now_ns: int = NOW_NS
    ) -> tuple[TransitionReasons, int]:
        """Return what runs finds."""
        config, given = record(self.config, CONFIG), new(HEALTH)
        given.view(np.int64)[:] = health
        law = config.law
        motion = np.array(q), np.array(qd)
        return call(arbitrate, config, self.task, self.state, given, frozen, law.joints, law.contacts, *motion, now_ns)

    def judge(
        self, memory: Memory, health=GOOD, frozen: bool = False, q=POSITION, qd=STILL, now_ns: int = NOW_NS
    ) -> Verdict:
        s, m = self.state, memory
        s.now_ns, s.mode.mode, s.latency.in_a_row = m.now_ns, m.mode, m.late_in_a_row
        self.task.path.scale = m.path_scale
        for name in TIMES:
            value = getattr(m, name)
            s.since[name] = NEVER if value is None else value
        s.since.wrench_bad_ns = NEVER if m.wrench_bad_ns is None else m.wrench_bad_ns
        s.observed.fall_speed, s.observed.path_speed, s.observed.moves = m.fall_speed, m.path_speed, m.reference_moves
        s.observed.twist[:], s.pad.contact.variance[:] = m.pad_twist, m.slip_variance
        s.estimate.unmeasured[:N] = m.unseen_ns // MS
        reason = of_fault(Cause.INPUT, Input.JOINT_STATE, Fault.FROZEN if m.frozen_before else Fault.LATE)
        put_reason(s.mode.reason, reason)
        for of, slip in zip(s.slip_inputs, m.slips, strict=False):
            of["values"][:], of["stamp_ns"] = slip, m.now_ns
        s.since.sliding_ns = m.now_ns - MS if m.slid_before else NEVER
        found, level = self.arbitrate((Fault.NONE, *health), frozen, q, qd, now_ns)
        texts = (describe(reason, self.names) for reason in (found.fault, found.hold, found.degraded))
        since = (None if t == NEVER else int(t) for t in (s.since.slip_unknown_ns, s.since.too_fast_ns))
        return Verdict(*texts, Level(level), *since)


def kinds() -> list[Arbitration]:
    safety = {"safety__inputs__joint__late_s": 0.01}
    return [
        Arbitration(**safety),
        Arbitration(slip_estimator="observer", **safety),
        Arbitration(controller="classical"),
        Arbitration(slip_sensor__latency_s=0.08, slip_sensor__rate_hz=25.0, **safety),
        Arbitration(slip_estimator="observer", joint_sensor__noise_velocity=0.003, **safety),
    ]


def test_joint_findings_carry_numbers() -> None:
    arbitration = Arbitration()
    found = arbitration.state.estimate
    found.finding, found.joint, found.value, found.limit = Finding.VELOCITY, 4, 0.3, 0.1
    reasons, _ = arbitration.arbitrate((Fault.NONE, *GOOD))
    assert reasons.fault == Reason(Cause.JOINT, 4 + 256 * Finding.VELOCITY, 0, 0.3, 0.1)
    found.finding, arbitration.state.observed.fall_speed = Finding.NONE, 9.0
    reasons, _ = arbitration.arbitrate((Fault.NONE, *GOOD))
    assert reasons.fault == Reason(Cause.FALLS, 0, 0, 9.0, 0.0)


def test_fall_exceeds_slip_uncertainty() -> None:
    """Found with a camera and motor currents: at rest the estimate drifted to 0.3 m/s, and that was a FAULT."""
    variance = np.array([1e-4, 4e-2, 0.0, 9.0, 9.0, 9.0])  # 3 sigma: 0.6 m/s
    for kind in kinds():
        drop = record(kind.config, CONFIG).drop.drop_speed
        doubt = 0.6 if record(kind.config, CONFIG).estimator.on else 0.0
        for speed in (drop + doubt - 0.01, drop + doubt + 0.01):
            verdict = kind.judge(QUIET._replace(fall_speed=speed, slip_variance=variance))
            assert ("the object falls" in verdict.fault) == bool(speed > drop + doubt)


def test_good_inputs_give_no_reason() -> None:
    for kind in kinds():
        assert kind.judge(QUIET) == Verdict("", "", "", Level.MEASURED, None, None)


def test_what_counts_first() -> None:
    """Of two reasons of one severity the one that a user has to act on; a reason to hold hides one to be careful."""
    kind, late = kinds()[0], QUIET._replace(late_in_a_row=10**6)
    silent, invalid = (Fault.SILENT, Fault.NONE, Fault.NONE), (Fault.NONE, Fault.INVALID, Fault.NONE)
    held = QUIET._replace(mode=Mode.HOLD)
    stops = QUIET._replace(stopping_ns=NOW_NS, path_speed=0.5)
    for memory, health, hold, degraded in (
        (late, (Fault.NONE, Fault.NONE, Fault.SECOND_PUBLISHER), "an input has two publishers", ""),
        (late._replace(mode=Mode.HOLD), silent, "wrench is silent", ""),
        (late, invalid, "joint state is late", ""),
        (held, invalid, "slip velocity is invalid", ""),
        (QUIET._replace(unseen_ns=10**9), invalid, "joint state is frozen", ""),
        (QUIET, silent, "", "wrench is silent: slowing down"),
        (QUIET, (Fault.FUTURE, Fault.NONE, Fault.NONE), "wrench is ahead of the joint state", ""),
        (stops, invalid, "", "slip velocity is invalid: slowing down"),
        (stops, GOOD, "", "hold requested: coming to rest first"),
        (stops._replace(stopping_ns=None), GOOD, "", "the path waits for the arm"),
    ):
        verdict = kind.judge(memory, health)
        assert (verdict.hold, verdict.degraded) == (hold, degraded)
    verdict = kind.judge(late, (Fault.NONE, Fault.NONE, Fault.FOREIGN_COMMAND))
    assert (verdict.fault, verdict.hold) == ("effort command has another publisher", "")


def test_levels_last_their_time() -> None:
    bad = (Fault.NONE, Fault.INVALID, Fault.NONE)
    for kind in kinds()[:2]:
        observer_ns, slow_ns = int(kind.limits.observer_ns), int(kind.limits.slow_down_ns)
        assert (observer_ns > 0) == (kind.controller.first.params.slip_estimator == "observer")
        expected = []
        if observer_ns:
            expected += [(0, Level.OBSERVED), (observer_ns - 1, Level.OBSERVED)]
        expected += [(observer_ns, Level.SLOWING), (observer_ns + slow_ns - 1, Level.SLOWING)]
        expected += [(observer_ns + slow_ns, Level.HOLD), (10 * (observer_ns + slow_ns), Level.HOLD)]
        since = kind.judge(QUIET, bad).slip_unknown_ns
        assert since == NOW_NS
        for passed, level in expected:
            memory = QUIET._replace(slip_unknown_ns=since, now_ns=NOW_NS + passed - MS)
            verdict = kind.judge(memory, bad, now_ns=NOW_NS + passed)
            assert (verdict.level, verdict.slip_unknown_ns) == (level, since)
            assert bool(verdict.hold) == (level == Level.HOLD)
        assert kind.judge(QUIET._replace(slip_unknown_ns=since), GOOD).slip_unknown_ns is None


def test_speed_must_last_five_milliseconds() -> None:
    kind = kinds()[0]
    qd = 2.0 * kind.controller.first.robot.velocity_limit * (np.arange(N) == 3)
    first = kind.judge(QUIET, qd=qd)
    assert (first.fault, first.too_fast_ns) == ("", NOW_NS)
    assert kind.judge(QUIET._replace(too_fast_ns=NOW_NS - 5 * MS), qd=qd).fault == ""
    assert kind.judge(QUIET._replace(too_fast_ns=NOW_NS - 5 * MS - 1), qd=qd).fault == (
        "arm_joint4 turns at 5.0 rad/s, the limit is 2.5"
    )
    assert kind.judge(QUIET._replace(too_fast_ns=NOW_NS - 6 * MS)).too_fast_ns is None


def test_law_waits_for_tare() -> None:
    slow = [f"{node}.control_period_s=0.004" for node in ("controller", "bridge")]
    loop = ClosedLoop(load_scenario("paper_planar", assignments=["controller.tare.duration_s=0.1", *slow]))
    reasons = []
    for _ in range(60):
        result = loop.control(loop.observe())
        reasons.append(str(result.reason))
        loop.bridge.advance([result.command])
    tares = [reason.startswith("tare: ") for reason in reasons]
    assert tares == [k < sum(tares) for k in range(60)]
    assert 25 <= sum(tares) <= 27, "0.1 s at 250 Hz"
    assert reasons[sum(tares)].startswith("resumes after: tare: ")
    assert result.mode.follows
