"""What speaks against the law in a cycle, in which order, and for how long slip may be unknown."""

from __future__ import annotations

from operator import attrgetter
from typing import NamedTuple

import numpy as np
import pytest

from slip_core.records import dtype_of, new, record
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load
from slip_vic_controller.contact.estimate import SensorHealth
from slip_vic_controller.cycle.deciding import judge, slows
from slip_vic_controller.safety.conditions import NOTHING, Health, Mode, Reason, Why, put_why
from slip_vic_controller.session.words import describe
from slip_vic_controller.sizes import NEVER
from slip_vic_controller.state import ARM_SIZE, ARM_STATE, CONFIG, TASK_SIZE, TASK_STATE
from test.support.call import call
from test.support.made_up import MS, NOW_NS, POSITION, N, controller_of

TWIST, STILL = np.zeros(6), np.zeros(N)
SLIP = (Reason.SLIP_PREDICTED, Reason.SLIP_SLOWS)


class Memory(NamedTuple):
    """What earlier cycles have left; None where something does not last."""

    now_ns: int
    mode: Mode
    slip_unknown_ns: int | None
    too_fast_ns: int | None
    stopping_ns: int | None
    fall_speed: float
    slip_variance: np.ndarray
    path_speed: float
    unseen_ns: int
    pad_twist: np.ndarray


class Verdict(NamedTuple):
    mode: Mode
    words: str
    slows: bool
    slip_unknown_ns: int | None
    too_fast_ns: int | None


QUIET = Memory(
    now_ns=NOW_NS - MS, mode=Mode.ACTIVE, slip_unknown_ns=None, too_fast_ns=None, stopping_ns=None, fall_speed=0.0,
    slip_variance=TWIST, path_speed=1.0, unseen_ns=0, pad_twist=TWIST,
)  # fmt: skip
NONE = Reason.NONE
GOOD = (NONE, NONE, NONE)


class Judge:
    """What judges the cycles of one kind of controller."""

    def __init__(self, **values) -> None:
        self.controller = controller_of(**values)
        self.config, self.buffer = self.controller.config, self.controller.new_state()
        self.task = record(self.buffer[:TASK_SIZE], TASK_STATE)
        self.state = record(self.buffer[TASK_SIZE:][:ARM_SIZE], ARM_STATE)
        self.limits = record(self.config, CONFIG).conditions
        self.state.conditions["since_ns"] = NEVER
        self.state.tare.done = 1
        self.names = self.controller.first.robot.joint_names

    def found(self, health=GOOD, q=POSITION, qd=STILL, now_ns: int = NOW_NS) -> Why:
        """Return what runs finds; health: of wrench, slip and who else publishes."""
        given, answers = new(dtype_of(Health)), self.state.joint.answers
        given.view(np.int64)[:] = (NONE, *health)
        answers.position[:N], answers.velocity[:N] = q, qd
        why = call(judge, record(self.config, CONFIG), self.task, self.state, given, now_ns)
        return Why(*why)

    def judge(self, memory: Memory, health=GOOD, q=POSITION, qd=STILL, now_ns: int = NOW_NS) -> Verdict:
        s, m, rows = self.state, memory, self.state.conditions
        s.now_ns, s.mode.mode = m.now_ns, m.mode
        rows["since_ns"] = NEVER
        times = dict.fromkeys(SLIP, m.slip_unknown_ns)
        times |= {Reason.TOO_FAST: m.too_fast_ns, Reason.STOPPING: m.stopping_ns}
        for reason, since_ns in times.items():
            rows[reason]["since_ns"] = NEVER if since_ns is None else since_ns
        s.observed.fall_speed, s.observed.path_speed = m.fall_speed, m.path_speed
        s.observed.twist[:], s.pad.contact.variance[:] = m.pad_twist, m.slip_variance
        s.estimate.unmeasured[:N] = m.unseen_ns // MS
        why = self.found(health, q, qd, now_ns)
        since = (rows[of]["since_ns"] for of in (Reason.SLIP_PREDICTED, Reason.TOO_FAST))
        comes_to_rest = bool(call(slows, record(self.config, CONFIG), s, now_ns))
        times_found = (None if t == NEVER else int(t) for t in since)
        return Verdict(Reason(why.reason).mode, describe(why, self.names), comes_to_rest, *times_found)


def kinds() -> list[Judge]:
    return [
        Judge(),
        Judge(slip_estimator="observer"),
        Judge(controller="classical"),
        Judge(slip_sensor__latency_s=0.08, slip_sensor__rate_hz=25.0),
        Judge(slip_estimator="observer", joint_sensor__noise_velocity=0.003),
    ]


def test_findings_carry_numbers() -> None:
    judging = Judge()
    found = Why(Reason.VELOCITY, 0, 0, 4, 0.3, 0.1)
    put_why(judging.state.estimate.found, found)
    assert judging.found() == found
    put_why(judging.state.estimate.found, NOTHING)
    judging.state.observed.fall_speed = 9.0
    assert judging.found() == Why(Reason.FALLS, 0, 0, 0, 9.0, 0.0)


@pytest.mark.parametrize(
    ("of", "field", "value", "reason"),
    [
        ("task.governor", "overrun", 1, Reason.OVERRUNS), ("task.governor", "endless", 1, Reason.ENDLESS_SLIP),
        ("state.law.given_up", "left_s", 0.1, Reason.GIVEN_UP), ("task.path", "scale", 0.5, Reason.PATH_WAITS),
        ("state.pad.contact", "slip_health", SensorHealth.READS_NOTHING, Reason.SLIP_SENSOR),
        ("state.pad.contact", "slip_health", SensorHealth.READS_NOTHING + 1, Reason.SLIP_SENSOR),
    ],
)  # fmt: skip
def test_what_keeps_the_law_from_its_path_is_named(of: str, field: str, value: float, reason: Reason) -> None:
    judging = Judge()
    judging.task.path.scale = judging.state.observed.path_speed = 1.0
    assert judging.found().reason == Reason.NONE
    setattr(attrgetter(of)(judging), field, value)
    assert judging.found().reason == reason


def test_fall_exceeds_slip_uncertainty() -> None:
    """Found with a camera and motor currents: at rest the estimate drifted to 0.3 m/s, and that was a FAULT."""
    variance = np.array([1e-4, 4e-2, 0.0, 9.0, 9.0, 9.0])  # 3 sigma: 0.6 m/s
    for kind in kinds():
        drop = record(kind.config, CONFIG).drop.drop_speed
        doubt = 0.6 if record(kind.config, CONFIG).estimator.on else 0.0
        for speed in (drop + doubt - 0.01, drop + doubt + 0.01):
            verdict = kind.judge(QUIET._replace(fall_speed=speed, slip_variance=variance))
            assert ("the object falls" in verdict.words) == bool(speed > drop + doubt)


def test_good_inputs_give_no_reason() -> None:
    for kind in kinds():
        assert kind.judge(QUIET) == Verdict(Mode.ACTIVE, "", False, None, None)


def test_what_counts_first() -> None:
    """Of two reasons of one mode the one that a user has to act on; a reason to hold hides one to be careful."""
    kind = kinds()[0]
    silent, invalid = (Reason.SILENT, NONE, NONE), (NONE, Reason.INVALID, NONE)
    held = QUIET._replace(mode=Mode.HOLD)
    stops = QUIET._replace(stopping_ns=NOW_NS, path_speed=0.5)
    hold, careful = Mode.HOLD, Mode.DEGRADED
    for memory, health, mode, words in (
        (QUIET, (NONE, NONE, Reason.SECOND_PUBLISHER), hold, "an input has two publishers"),
        (held, silent, hold, "wrench is silent"),
        (held, invalid, hold, "slip velocity is invalid"),
        (QUIET._replace(unseen_ns=10**9), invalid, hold, "joint state is frozen"),
        (QUIET, silent, careful, "wrench is silent: slowing down"),
        (QUIET, (Reason.FUTURE, NONE, NONE), hold, "wrench is ahead of the joint state"),
        (stops, invalid, careful, "slip velocity is invalid: slowing down"),
        (stops, GOOD, careful, "hold requested: coming to rest first"),
        (stops._replace(stopping_ns=None), GOOD, careful, "the path waits for the arm"),
        (QUIET, (NONE, NONE, Reason.FOREIGN_COMMAND), Mode.FAULT, "effort command has another publisher"),
    ):
        verdict = kind.judge(memory, health)
        assert (verdict.mode, verdict.words) == (mode, words)


@pytest.mark.parametrize("index", [0, 1])
def test_unknown_slip_lasts_its_time(index: int) -> None:
    """Predicted where there is an observer, then the path comes to rest, then HOLD."""
    kind, bad = kinds()[index], (NONE, Reason.INVALID, NONE)
    observer_ns, slow_ns = int(kind.limits.lasts_ns[Reason.SLIP_SLOWS]), int(kind.limits.slow_down_ns)
    assert (observer_ns > 0) == (kind.controller.first.params.slip_estimator == "observer")
    careful, over = Mode.DEGRADED, observer_ns + slow_ns
    expected = [(0, careful, False), (observer_ns - 1, careful, False)] if observer_ns else []
    expected += [(observer_ns, careful, True), (over - 1, careful, True)]
    expected += [(over, Mode.HOLD, True), (10 * over, Mode.HOLD, True)]
    since = kind.judge(QUIET, bad).slip_unknown_ns
    assert since == NOW_NS
    for passed, mode, comes_to_rest in expected:
        memory = QUIET._replace(slip_unknown_ns=since, now_ns=NOW_NS + passed - MS)
        verdict = kind.judge(memory, bad, now_ns=NOW_NS + passed)
        assert (verdict.mode, verdict.slows, verdict.slip_unknown_ns) == (mode, comes_to_rest, since)
    assert kind.judge(QUIET._replace(slip_unknown_ns=since), GOOD).slip_unknown_ns is None


def test_speed_must_last_five_milliseconds() -> None:
    kind = kinds()[0]
    qd = 2.0 * kind.controller.first.robot.velocity_limit * (np.arange(N) == N - 1)
    first = kind.judge(QUIET, qd=qd)
    assert (first.words, first.too_fast_ns) == ("", NOW_NS)
    assert kind.judge(QUIET._replace(too_fast_ns=NOW_NS - 5 * MS), qd=qd).words == ""
    assert kind.judge(QUIET._replace(too_fast_ns=NOW_NS - 5 * MS - 1), qd=qd).words == (
        "arm_joint7 moves at 5.0 rad/s or m/s, the limit is 2.5"
    )
    assert kind.judge(QUIET._replace(too_fast_ns=NOW_NS - 6 * MS)).too_fast_ns is None


def test_speeds_have_one_clock() -> None:
    """A loop that runs away shows in a joint, then in the pad."""
    kind, fast = kinds()[0], np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    verdict = kind.judge(QUIET._replace(too_fast_ns=NOW_NS - 5 * MS - 1, pad_twist=fast))
    assert verdict.words.startswith("the pad moves at 100.0 ")


def test_law_waits_for_tare() -> None:
    slow = [f"{node}.control_period_s=0.004" for node in ("controller", "bridge")]
    loop = ClosedLoop(load("paper_planar", law="vic", set=["controller.tare.duration_s=0.1", *slow]))
    reasons = []
    for _ in range(60):
        result = loop.answer(loop.bridge.observe())[0]
        reasons.append(str(result.reason))
        loop.bridge.advance([result.command])
    tares = [reason.startswith("tare: ") for reason in reasons]
    assert tares == [k < sum(tares) for k in range(60)]
    assert 25 <= sum(tares) <= 27, "0.1 s at 250 Hz"
    assert reasons[sum(tares)] == "the path waits for the arm", "the inputs were good all the while"
    assert result.mode.follows
