"""Goals by users: governed, blended, refused in one line, and replayed to the last bit."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_core.types import PoseGoal
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import verify_run
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load
from slip_vic_controller.node.task_topics import GoalWatch
from slip_vic_controller.safety.conditions import Mode, Request
from test.support.run_maker import goal_message, record_run

HELD_M = 1e-7
PAPER = np.array([0.4, 0.3, 0.0]), np.array([0.0, 0.0, 0.8]), 2.0


class Run:
    """A closed loop whose goals are relative to where the pad began; `at` does something at a tick."""

    def __init__(self, scenario: str, controller: str, seconds: float, at, *assignments: str) -> None:
        loaded = load(
            scenario, law=controller,
            set=("controller.trajectory.kind=goal", f"bridge.duration_s={seconds}", *assignments),
        )  # fmt: skip
        self.loop = loop = ClosedLoop(loaded)
        listener, self.lines, self.references, self.slip_m, self.load = GoalWatch(loop.session), [], [], 0.0, 0.0
        for tick in range(round(1000 * seconds)):
            outputs = loop.bridge.observe()
            if tick in at:
                at[tick](self)
            self.result = loop.answer(outputs)[0]
            record = self.result.record
            reference = record.reference
            pose = np.array(reference.position), np.array(reference.rotation), np.array(reference.twist)
            self.references.append(pose)
            self.lines += listener.changes()
            self.slip_m = max(self.slip_m, float(np.linalg.norm(outputs.truth.slip_displacement[:3])))
            self.load = max(self.load, float(record.governor.load_ratio))
            loop.bridge.advance([self.result.command])

    def give(self, displacement, turn, duration_s: float) -> None:
        x, R, _ = self.references[0]
        self.goal = x + displacement, Rotation.from_rotvec(turn).as_matrix() @ R
        self.loop.session.set_goal(PoseGoal(*self.goal, duration_s))


def test_new_goal_waits_for_rest() -> None:
    first, second = lambda run: run.give(*PAPER), lambda run: run.give([0.1, 0.3, 0.0], [0.0, 0.0, 0.4], 1.0)
    run = Run("paper_planar", "governed", 5.0, {5: first, 900: second})
    assert run.lines == [
        "goal 1 moves",
        "goal 2 waits until the pad is at rest on its current path",
        "goal 2 moves",
        "goal 2 reached",
    ]
    assert run.slip_m < HELD_M
    assert run.load <= 1.0 + 1e-9
    x, R, twist = run.references[-1]
    assert np.abs(x - run.goal[0]).max() < 1e-9
    assert np.abs(R - run.goal[1]).max() < 1e-9
    assert not twist.any()
    assert run.result.scalars()["goal_progress"] == 1.0
    assert run.result.record.law.error_linear < 1e-3


def test_impossible_goal_is_refused() -> None:
    heavy = Run(
        "vertical_plane", "governed", 0.2, {5: lambda run: run.give([0.0, 0.3, 0.15], [0.4, 0.0, 0.0], 0.8)},
        "controller.governor.margin=0.95",
    )  # fmt: skip
    (refusal,) = heavy.lines
    assert refusal.startswith("goal 1 refused: friction cannot carry the object at 0.800 s of its path: ")
    assert heavy.result.mode == Mode.ACTIVE
    assert np.abs(heavy.references[-1][0] - heavy.references[0][0]).max() < 1e-9

    fast = Run("paper_planar", "classical", 0.02, {5: lambda run: run.give([0.4, 0.0, 0.0], [0.0] * 3, 0.1)})
    assert fast.lines == ["goal 1 refused: it needs 7.50 m/s, the limit is 2.25: allow more time"]

    def hold_then_give(run: Run) -> None:
        run.loop.session.request(Request.HOLD)

    late = Run("paper_planar", "classical", 1.1, {5: hold_then_give, 1090: lambda run: run.give(*PAPER)})
    assert late.lines == ["goal 1 refused: the law is not active, see controller/mode"]


def test_runs_with_goals_replay_identically(tmp_path) -> None:
    for controller in ("governed", "vic"):
        loaded = load(
            "paper_planar", law=controller,
            set=("controller.trajectory.kind=goal", "bridge.duration_s=0.3", "bridge.friction.mu_s=0.2",
                         "bridge.friction.mu_k=0.15"),
        )  # fmt: skip
        goals = {
            5: goal_message((-0.1, 0.35, 0.5), (0, 0, 0.9, 0.4), 0.5),
            200: goal_message((0, 0, 0.4), (0, 0, 1, 0), 0.4),
        }
        record_run(tmp_path / controller, loaded, goals=goals)
        bag = Bag(tmp_path / controller)
        verdict = verify_run(read_run(bag))
        assert verdict.text() == "identical: 300 cycles, 2100 efforts, to the last bit"
