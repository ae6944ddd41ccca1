"""The joint state estimator in the control cycle: noise, wrong sensors, a push, and its place in the state."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slip_core.records import new, record
from slip_core.types import EffortCommand
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.arm.joint_estimate import Finding
from slip_vic_controller.cycle.deciding import _with_disturbance
from slip_vic_controller.safety.modes import Mode, Request
from slip_vic_controller.safety.reasons import Cause, Reason
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.state import CONFIG, INPUTS
from test.support.call import call
from test.support.watched_loop import WatchedLoop, with_joints

NOISE = 0.003
TOLD = (
    f"bridge.sensors.joint.noise_velocity={NOISE}", "bridge.sensors.joint.noise_position=1e-5",
    f"controller.joint_sensor.noise_velocity={NOISE}",
)  # fmt: skip
EXACT = (
    "bridge.sensors.joint.noise_velocity=0.0", "bridge.sensors.joint.noise_position=0.0",
    "controller.joint_sensor.noise_velocity=0.0",
)  # fmt: skip
SIGNS = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0])


class Run(WatchedLoop):
    """A closed loop whose joint states and efforts can be made wrong on their way."""

    def __init__(self, *assignments: str, law: Any = "governed", name: str = "paper_planar") -> None:
        super().__init__(load_scenario(name, law=law, sensor="event_1000", seed=5, assignments=(*TOLD, *assignments)))
        self.arm = self.loop.controller

    def cycles(self, count: int, change: Any = None, push: Any = None) -> CycleResult:
        """Return the last result; change(q, qd): of the joint states; push: added to every effort [N m]."""

        def sensed(arm: Any) -> Any:
            if change is None:
                return arm
            return with_joints(arm, *change(arm.joint.position.copy(), arm.joint.velocity.copy()))

        def sent(command: Any) -> Any:
            if push is None or not len(command.effort):
                return command
            return EffortCommand(command.stamp_ns, command.effort + push)

        for _ in range(count):
            result = self.cycle(sensed, sent)
        return result


def test_the_law_works_with_the_estimate() -> None:
    run = Run()
    run.cycles(400)
    estimate, answers = run.arm.state.estimate, run.arm.state.joint.answers
    assert estimate.started == 1
    np.testing.assert_array_equal(estimate.position[:7], answers.position[:7])
    np.testing.assert_array_equal(estimate.velocity[:7], answers.velocity[:7])
    assert (estimate.velocity[:7] != run.arm.state.joint.last.velocity[:7]).all()


def test_a_torque_offset_is_found_and_taken_off() -> None:
    run = Run()
    offset = 0.2 * SIGNS
    run.cycles(600, push=offset)
    estimate = run.arm.state.estimate
    taken_off = []
    for _ in range(100):
        run.cycles(1, push=offset)
        taken_off.append(estimate.taken_off[:7].copy())
    np.testing.assert_allclose(np.mean(taken_off, axis=0), -offset, atol=0.05)


@pytest.mark.parametrize(
    ("joint", "change", "finding"),
    [
        (1, lambda q, qd: -qd, Finding.VELOCITY_SIGN),
        (3, lambda q, qd: 0.0 * qd, Finding.VELOCITY_STUCK),
        (3, lambda q, qd: qd + 1.5, Finding.VELOCITY_BIASED),
    ],
)
def test_a_wrong_velocity_is_a_fault_with_the_joint_s_name_and_the_arm_rests(joint: int, change: Any, finding) -> None:
    run = Run()
    run.cycles(500)

    def wrong(q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        qd[joint] = change(q[joint], qd[joint])
        return q, qd

    result = run.cycles(1500, wrong)
    assert result.mode == Mode.FAULT
    name = run.arm.controller.robot.joint_names[joint]
    assert result.reason.startswith(f"{name}: its velocity ")
    assert run.arm.state.estimate.finding == finding
    run.cycles(1)
    assert run.speed < 0.1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda q, qd, first: (q, -qd), "its velocity has the wrong sign"),
        (lambda q, qd, first: (q, 0.0), "its velocity is stuck"),
        (lambda q, qd, first: (first, qd), "its position is stuck"),
    ],
)
def test_samples_that_are_used_as_they_are_may_not_contradict_each_other(change: Any, words: str) -> None:
    """Without noise configured a wrong sign threw the arm to 90 rad/s."""
    run, joint, fastest = Run(*EXACT), 3, 0.0
    first = run.cycles(900).joint.position[joint]
    assert not run.arm.estimated_joints

    def wrong(q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q[joint], qd[joint] = change(q[joint], qd[joint], first)
        return q, qd

    for _ in range(50):
        result = run.cycles(30, wrong)
        fastest = max(fastest, run.speed)
    assert result.mode == Mode.FAULT
    assert result.reason.startswith(f"{run.arm.controller.robot.joint_names[joint]}: {words}"), result.reason
    assert fastest < 2.0
    assert run.speed < 0.1


def test_a_push_is_a_collision() -> None:
    run = Run()
    run.cycles(600)
    push = np.array([0.0, 35.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    result = run.cycles(30, push=push)
    assert result.mode == Mode.FAULT
    assert result.reason.startswith("collision: the torque on ")
    assert run.arm.controller.robot.joint_names[1] in result.reason


def test_the_law_goes_on_where_the_model_has_the_arm() -> None:
    """What is taken off against the disturbance stays; the efforts are those that good joint states would give."""
    (bad, good), offset = (Run(), Run()), 0.2 * SIGNS
    for run in (bad, good):
        run.cycles(600, push=offset)
    taken_off = bad.arm.state.estimate.taken_off.copy()
    assert (np.abs(taken_off[:7]) > 0.05).all()
    for _ in range(48):
        lost = bad.cycles(1, change=lambda q, qd: (q, np.nan * qd), push=offset)
        seen = good.cycles(1, push=offset)
        np.testing.assert_array_equal(bad.arm.state.estimate.taken_off, taken_off)
        assert lost.mode.follows
        np.testing.assert_allclose(lost.command.effort, seen.command.effort, atol=0.5)
    now = [run.loop.bridge.simulation.observe(0).joint.position for run in (bad, good)]
    np.testing.assert_allclose(*now, atol=3e-4)


def test_the_estimate_is_part_of_the_state() -> None:
    """A session that is restored from a snapshot gives the same efforts to the last bit."""
    run = Run()
    run.cycles(300)
    kept = run.loop.controller.snapshot()
    outputs, counts = run.loop.observe(), (list(run.arm._wrench_counts), list(run.arm._slip_counts))
    assert answer_bytes(run, kept, outputs, counts) == answer_bytes(run, kept, outputs, counts)


def answer_bytes(run: Run, kept: np.ndarray, outputs: Any, counts: tuple[list[int], list[int]]) -> bytes:
    run.arm.restore(kept)
    run.arm._wrench_counts, run.arm._slip_counts = map(list, counts)
    return run.loop.control(outputs).record.effort.tobytes() + run.loop.controller.snapshot().tobytes()


@pytest.mark.parametrize("finding", tuple(each for each in Finding if each != Finding.NONE))
def test_one_reset_ends_the_fault_of_what_was_found_and_is_gone(finding: Finding) -> None:
    """What has been found stays until a user resets it: the first reset forgot it, and only a second one was heard."""
    loop = ClosedLoop(load_scenario("paper_planar"))

    def cycle(request: Request = Request.NONE) -> Mode:
        loop.session.request(request)
        result = loop.control(loop.observe())
        loop.bridge.advance([result.command])
        return Mode(result.mode)

    assert [cycle() for _ in range(5)][-1] == Mode.ACTIVE
    found = loop.controller.state.estimate
    found.finding, found.joint, found.value, found.limit = finding, 2, 1.0, 0.5
    assert [cycle() for _ in range(100)][-1] == Mode.FAULT
    assert cycle(Request.RESET_FAULT) == Mode.HOLD
    assert cycle(Request.ENABLE) in (Mode.ACTIVE, Mode.DEGRADED)


@pytest.mark.parametrize(("share", "named"), [(0.01, False), (0.03, True)])
def test_a_fault_names_a_disturbance_that_is_more_than_little(share: float, named: bool) -> None:
    loop = ClosedLoop(load_scenario("paper_planar", assignments=TOLD))
    loop.control(loop.observe())
    arm, inputs = loop.controller, record(new(INPUTS), INPUTS)
    n, limit = 7, record(arm.config, CONFIG).law.effort_limit
    inputs.arm.M[:n, :n] = np.eye(n)
    arm.state.estimate.d[:] = 0.0
    arm.state.estimate.d[3] = share * limit[3]
    fault = Reason(Cause.FALLS.value, 0, 0, 0.3, 0.0)
    said = call(_with_disturbance, arm.config, arm.state, inputs, fault)
    assert (said != fault) is named
