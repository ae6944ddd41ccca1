"""A closed loop in process whose messages can be changed on their way, and what the arm really does in it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from slip_core.arrays import Array
from slip_core.types import JointSample
from slip_vic.run.in_process import ClosedLoop
from slip_vic.scenarios.scenario import Scenario
from slip_vic_controller.session.cycle_result import CycleResult

Change = Callable[[Any], Any]


class WatchedLoop:
    """One arm, controller and simulation, cycle by cycle."""

    def __init__(self, scenario: Scenario) -> None:
        self.loop, self.fastest = ClosedLoop(scenario), 0.0

    def cycle(self, sensed: Change | None = None, sent: Change | None = None) -> CycleResult:
        """Run a cycle; sensed(arm): what arrives of its samples; sent(command): what arrives of it, None = nothing."""
        outputs = self.loop.bridge.observe()
        if sensed is not None:
            outputs = outputs._replace(arms=tuple(sensed(arm) for arm in outputs.arms))
        result = self.loop.answer(outputs)[0]
        self.loop.bridge.advance([result.command if sent is None else sent(result.command)])
        self.fastest = max(self.fastest, self.speed)
        return result

    @property
    def speed(self) -> float:
        """Largest true joint velocity [rad/s]."""
        return float(np.abs(self.loop.bridge.simulation.observe(0).joint.velocity).max())

    @property
    def slip(self) -> float:
        """How far the object has slipped [m]."""
        return float(np.linalg.norm(self.loop.bridge.simulation.observe(0).truth.slip_displacement[:3]))


def with_joints(arm: Any, q: Array, qd: Array) -> Any:
    """Return the samples of an arm with other joint positions and velocities (n,) [rad], [rad/s]."""
    return arm._replace(joint=JointSample(arm.joint.stamp_ns, q, qd, arm.joint.effort))
