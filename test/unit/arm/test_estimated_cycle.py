"""The joint state estimator in the control cycle: noise and wrong sensors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slip_core.records import record
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import load
from slip_vic_controller.safety.conditions import Mode, Reason, Request, Why, put_why
from slip_vic_controller.session.cycle_result import CycleResult
from slip_vic_controller.state import CONFIG
from test.support.watched_loop import WatchedLoop, with_joints

NOISE = 0.003
TOLD = (
    f"bridge.sensors.joint.noise_velocity={NOISE}", "bridge.sensors.joint.noise_position=1e-5",
    f"controller.joint_sensor.noise_velocity={NOISE}",
)  # fmt: skip


class Run(WatchedLoop):
    """A closed loop whose joint states can be made wrong on their way."""

    def __init__(self, *assignments: str, law: Any = "governed", name: str = "paper_planar") -> None:
        super().__init__(load(name, law=law, sensor="event_1000", seed=5, set=(*TOLD, *assignments)))
        self.arm = self.loop.session.arms[0]

    def cycles(self, count: int, change: Any = None) -> CycleResult:
        """Return the last result; change(q, qd): of the joint states."""

        def sensed(arm: Any) -> Any:
            if change is None:
                return arm
            return with_joints(arm, *change(arm.joint.position.copy(), arm.joint.velocity.copy()))

        for _ in range(count):
            result = self.cycle(sensed)
        return result


@pytest.mark.parametrize(
    ("joint", "change", "finding"),
    [
        (1, lambda q, qd: -qd, Reason.VELOCITY),
        (3, lambda q, qd: 0.0 * qd, Reason.VELOCITY),
        (3, lambda q, qd: qd + 1.5, Reason.VELOCITY),
    ],
)
def test_wrong_velocity_names_joint(joint: int, change: Any, finding) -> None:
    run = Run()
    run.cycles(500)

    def wrong(q: np.ndarray, qd: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        qd[joint] = change(q[joint], qd[joint])
        return q, qd

    result = run.cycles(1700, wrong)
    assert result.mode == Mode.FAULT
    name = run.arm.controller.robot.joint_names[joint]
    assert result.reason.startswith(f"{name}: velocity ")
    assert run.arm.state.estimate.found.reason == finding
    run.cycles(1)
    assert run.speed < 0.1


def test_estimate_is_published() -> None:
    run = Run()
    published, q = run.cycles(9).record.joints.position, run.arm.state.estimate.position
    assert published.tolist() == q.tolist() != [0.0] * len(q)


def test_noise_that_a_tare_measures_is_used() -> None:
    """The speed that counts as slip follows it."""
    run = Run("controller.tare.duration_s=0.3", "bridge.sensors.slip.noise_linear=0.02")
    speeds = []
    for _ in range(2):
        speeds.append(float(record(run.arm.config, CONFIG).governor.friction.threshold))
        run.cycles(450)
    assert speeds[1] > 2.0 * speeds[0]


@pytest.mark.parametrize("finding", tuple(each for each in Reason if Reason.VELOCITY <= each <= Reason.IGNORED))
def test_one_reset_clears_findings(finding: Reason) -> None:
    """What has been found stays until a user resets it: the first reset forgot it, and only a second one was heard."""
    loop = ClosedLoop(load("paper_planar", law="vic"))

    def cycle(request: Request = Request.NONE) -> Mode:
        loop.session.request(request)
        result = loop.answer(loop.bridge.observe())[0]
        loop.bridge.advance([result.command])
        return Mode(result.mode)

    assert [cycle() for _ in range(5)][-1] == Mode.ACTIVE
    put_why(loop.session.arms[0].state.estimate.found, Why(finding, 0, 0, 2, 1.0, 0.5))
    assert [cycle() for _ in range(100)][-1] == Mode.FAULT
    assert cycle(Request.RESET_FAULT) == Mode.HOLD
    assert cycle(Request.ENABLE) in (Mode.ACTIVE, Mode.DEGRADED)
