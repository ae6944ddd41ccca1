"""References and goals of an object that two arms hold: every pad keeps to it; and a controller of three arms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slip_core.arrays import matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.params import build
from slip_core.types import CartesianReference, JointSample, PoseGoal, SlipSample, WrenchSample
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import Law, load
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.path.goals import GoalPhase
from slip_vic_controller.safety.conditions import Mode, Request
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.session.session import ControllerSession
from test.support.small_arm import HOME, small_arm_urdf

WAY, TURN = np.array([0.02, 0.03, -0.01]), np.array([0.0, 0.0, 0.03])
MS = 1_000_000


class Run:
    """Two arms that carry the pane by topic; results and slip of every tick."""

    def __init__(self, law: Law, kind: str, *assignments: str) -> None:
        self.loop = ClosedLoop(
            load("pane_two_arms_upright", law=law, set=(f"controller.trajectory.kind={kind}", *assignments))
        )
        self.results: list[tuple[CycleResult, ...]] = []
        self.slip_m = 0.0
        self.tick()
        self.start = self.object_pose()

    def tick(self, count: int = 1) -> None:
        for _ in range(count):
            outputs = self.loop.bridge.observe()
            self.results.append(self.loop.answer(outputs))
            for arm in outputs.arms:
                self.slip_m = max(self.slip_m, float(np.linalg.norm(arm.readings.truth.slip_displacement[:3])))
            self.loop.bridge.advance([result.command for result in self.results[-1]])

    def object_pose(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the object's pose as the first arm's grasp and pad have it."""
        grasp, arm = self.loop.session.arms[0].controller.params.contacts, self.results[-1][0].arm
        R = np.array(arm.rotation) @ matrix_from_quat_xyzw(grasp.orientation_xyzw[:4]).T
        return np.array(arm.position) - R @ np.array(grasp.position[:3]), R

    def moved(self, share: float) -> tuple[np.ndarray, np.ndarray]:
        x, R = self.start
        return x + share * WAY, Rotation.from_rotvec(share * TURN).as_matrix() @ R

    def check_grasps(self) -> None:
        """Every reference of the second pad is the first one's, carried by the object."""
        first = [result.record.reference for result in self.results[-1]]
        arms = [result.arm for result in self.results[0]]
        apart = arms[0].rotation.T @ (arms[1].position - arms[0].position)
        np.testing.assert_allclose(first[1].position, first[0].position + first[0].rotation @ apart, atol=1e-12)
        np.testing.assert_allclose(
            first[1].rotation, first[0].rotation @ arms[0].rotation.T @ arms[1].rotation, atol=1e-12
        )
        np.testing.assert_array_equal(first[1].twist[3:], first[0].twist[3:])
        lever = first[0].rotation @ apart
        np.testing.assert_allclose(
            first[1].twist[:3], first[0].twist[:3] + np.cross(first[0].twist[3:], lever), atol=1e-12
        )


@pytest.mark.parametrize("law", ["vic", "governed"])
def test_both_pads_reach_object_goal(law: Law) -> None:
    run = Run(law, "goal")
    run.tick(20)
    goal = run.moved(1.0)
    run.loop.session.set_goal(PoseGoal(*goal, 0.6))
    run.tick(300)
    run.check_grasps()
    assert float(np.linalg.norm(run.results[-1][1].record.reference.twist)) > 0.01
    run.tick(700)
    assert run.loop.session.task.goal.phase == GoalPhase.REACHED
    x, R = run.object_pose()
    assert np.abs(x - goal[0]).max() < 2e-3
    assert np.abs(R - goal[1]).max() < 4e-3
    run.check_grasps()
    assert run.slip_m < 1e-4


@pytest.mark.parametrize("law", ["vic", "governed"])
def test_object_references_lead_both_pads(law: Law) -> None:
    run = Run(law, "topic")
    run.tick(20)
    six = np.concatenate((WAY, TURN))
    for k in range(800):
        s = min(k / 600, 1.0)
        p, v, a = (
            s**3 * (10 - 15 * s + 6 * s * s),
            30 * s * s * (1 - s) ** 2 / 0.6,
            (60 * s - 180 * s**2 + 120 * s**3) / 0.36,
        )
        if k % 10 == 0:
            x, R = run.moved(p)
            run.loop.session.set_reference(CartesianReference(x, R, v * six, a * six, (5000 + k) * MS))
        run.tick()
        if k == 300:
            run.check_grasps()
            assert float(np.linalg.norm(run.results[-1][1].record.reference.twist)) > 0.01
    run.tick(300)
    x, R = run.object_pose()
    assert np.abs(x - run.moved(1.0)[0]).max() < 2e-3
    assert np.abs(R - run.moved(1.0)[1]).max() < 4e-3
    assert run.slip_m < 1e-4
    assert {result.mode for results in run.results[2:] for result in results} <= {Mode.ACTIVE, Mode.DEGRADED}


def test_holding_arm_refuses_the_goal() -> None:
    run = Run("vic", "goal")
    run.tick(20)
    run.loop.session.arms[1].request(Request.FAILED)
    run.tick(2)
    run.loop.session.set_goal(PoseGoal(*run.moved(1.0), 0.6))
    run.tick(2)
    goal = run.loop.session.task.goal
    assert (goal.pending, goal.refused, goal.phase) == (0, 1, GoalPhase.RESTS)


# -- three arms, without a simulation: the cycle knows no number of arms --------------------------


THREE = ("front", "left", "right")
CONTACTS = {
    "contacts.position": [0.1, 0.0, 0.0, -0.1, 0.0, 0.0, 0.0, 0.1, 0.0],
    "contacts.orientation_xyzw": [0.0, 0.0, 0.0, 1.0] * 3,
    "contacts.slip_axes": [True] * 18,
}


class Three:
    """Three arms that stand still, with made-up samples; each knows all pads, its own first."""

    def __init__(self, **values: object) -> None:
        position = np.array(CONTACTS["contacts.position"]).reshape(3, 3)
        params = {}
        for k, name in enumerate(THREE):
            order = [k, *(j for j in range(3) if j != k)]
            own = {**CONTACTS, "contacts.position": position[order].ravel().tolist()}
            named = {name.replace("__", "."): value for name, value in values.items()}
            params[name] = build(ControllerParams, {**own, **named}, "test")
        self.session = ControllerSession(Controller(params, dict.fromkeys(THREE, small_arm_urdf()), lockstep=False))
        self.now_ns = 5_000 * MS

    def deliver(self, skip: tuple[int, ...] = (), silent: tuple[int, ...] = ()) -> None:
        self.now_ns += MS
        noise = 1e-7 * np.random.default_rng(self.now_ns // MS).uniform(-1.0, 1.0, 7)
        for k, arm in enumerate(self.session.arms):
            if k in silent:
                continue
            arm.add_wrench(
                0, WrenchSample(self.now_ns, np.array([0.0, 0.0, -1.6, 0.0, 0.0, 0.0]) + noise[:6]), self.now_ns
            )
            arm.add_slip(0, SlipSample(self.now_ns, np.zeros(6)), self.now_ns)
            if k not in skip:
                arm.add_joint(JointSample(self.now_ns, np.array(HOME) + noise, np.zeros(7), np.zeros(7)), self.now_ns)

    def cycle(self, **given: tuple[int, ...]) -> tuple[CycleResult | None, ...]:
        self.deliver(**given)
        return self.session.cycle(self.now_ns)

    def modes(self) -> list[Mode]:
        return [arm.mode for arm in self.session.arms]


def test_three_arms_share_a_cycle() -> None:
    three = Three()
    for _ in range(30):
        results = three.cycle()
    assert three.modes() == [Mode.ACTIVE] * 3
    for k, result in enumerate(results):
        assert result is not None
        assert len(result.ledger) == 3 + 4 * 3
        wrenches = [result.record.samples[i].wrench[2] for i in range(3)]
        assert np.allclose(wrenches, -1.6, atol=1e-6), k
    assert len({result.record.reference.position.tobytes() for result in results if result is not None}) == 1
    assert three.session.task.start_ns == results[0].joint.stamp_ns - 29 * MS, "the law has begun once"
    for arm in three.session.arms:
        np.testing.assert_allclose(arm.state.grasp.rotation, np.eye(3), atol=1e-12)


def test_three_arms_wait_for_late_one() -> None:
    three = Three()
    for _ in range(30):
        three.cycle()
    assert three.cycle(skip=(2,)) == (None, None, None), "its joint state may still come"
    answered = None
    for _ in range(200):
        results = three.cycle(silent=(2,))
        if any(result is not None for result in results):
            answered = results
            break
    assert answered is not None
    assert all(result is not None for result in answered), "two by their joint states, the silent one by its watchdog"
    assert not any(mode.follows for mode in three.modes())
    for _ in range(400):
        three.cycle()
    assert all(mode.follows for mode in three.modes())


@pytest.mark.parametrize(
    ("name", "value"), [("trajectory.kind", "goal"), ("governor.mode", "slow_down"), ("control_period_s", 0.002)]
)
def test_arms_must_agree_on_parameters(name: str, value: object) -> None:
    params = {"left": build(ControllerParams, {}, "test"), "right": build(ControllerParams, {name: value}, "test")}
    with pytest.raises(InputError, match=name):
        Controller(params, dict.fromkeys(params, small_arm_urdf()), lockstep=False)
