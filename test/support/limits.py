"""What a controller requires of the arm in a scenario."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import Law, Scenario, load_scenario
from slip_vic_controller.robot import Robot
from slip_vic_controller.safety.modes import Mode

LONG_ENOUGH = "bridge.duration_s=2.5"
"""All paths have ended by then."""


@dataclass
class Asked:
    """What was asked of the arm: slope of the law's efforts [N m/s], efforts and velocities over the URDF's limits.

    limited: whether an effort was clipped or slowed down; end: mode at the end or at a FAULT, with time and reason.
    """

    slope: float = 0.0
    effort: float = 0.0
    velocity: float = 0.0
    limited: bool = False
    slip_m: float = 0.0
    end: str = ""


def asked(scenario: Scenario) -> Asked:
    """Run a scenario until its end or a FAULT and return what it asked of the arm."""
    params, found, before = scenario.controller, Asked(), None
    robot = Robot(scenario.urdf, params.ee_frame, params.joint_names, params.gravity)
    n = len(params.joint_names)
    for tick in run_in_process(scenario):
        record = tick.result.record
        wanted = np.array(record.wanted[:n])
        if before is not None and tick.result.ok:
            found.slope = max(found.slope, float(np.abs(wanted - before).max()) / params.control_period_s)
        before = wanted
        found.effort = max(found.effort, float((np.abs(wanted) / robot.effort_limit).max()))
        found.velocity = max(
            found.velocity, float((np.abs(tick.outputs.arms[0].joint.velocity) / robot.velocity_limit).max())
        )
        found.limited |= bool(record.saturated[:n].any())
        found.slip_m = max(found.slip_m, float(np.linalg.norm(tick.outputs.truth.slip_displacement[:3])))
        found.end = f"{tick.result.mode.name} {tick.result.reason}".strip()
        if tick.result.mode == Mode.FAULT:
            found.end = f"FAULT at {1e-9 * tick.outputs.stamp_ns:.3f} s: {tick.result.reason}"
            break
    return found


def shipped(name: str, kind: Law, assignments: Iterable[str] = ()) -> Scenario:
    return load_scenario(name, law=kind, assignments=(LONG_ENOUGH, *assignments))
