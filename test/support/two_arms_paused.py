"""What two arms do when their controller is paused."""

from __future__ import annotations

import dataclasses

import numpy as np

from slip_core.types import JointCommand
from slip_vic.scenarios.scenario import load_scenario
from slip_vic_controller.session.controller import Controller
from slip_vic_controller.session.session import ControllerSession
from test.campaigns.faults.pair import STEADY_NS

ENDS_S, LAST_S = 2.0, 0.3


def fastest_joint(name: str, rate_hz: int, pauses: tuple[tuple[float, float], ...]) -> tuple[float, float]:
    """Return how fast a joint of either arm turns at most, and in the last LAST_S [rad/s]."""
    period_s = 1.0 / rate_hz
    scenario = load_scenario(
        name,
        assignments=[
            f"controller.control_period_s={period_s}", f"bridge.control_period_s={period_s}",
            "controller.mode=realtime", "bridge.mode=realtime", "controller.gains.k_s=20.0",
            "controller.gains.kappa=0.03", "controller.trajectory.start_s=0.0", "controller.trajectory.duration_s=1.2",
        ],
    )  # fmt: skip
    team = ControllerSession(Controller(scenario.controllers, scenario.placed, lockstep=False))
    bridge, speeds = scenario.bridge_session(), []
    newest: list[JointCommand | None] = [None] * len(team.arms)
    for tick in range(round(ENDS_S * rate_hz)):
        t = tick * period_s
        outputs, now_ns = bridge.observe(), STEADY_NS + round(1e9 * t)
        speeds.append(max(float(np.abs(arm.joint.velocity).max()) for arm in outputs.arms))
        if not any(begins_s <= t < ends_s for begins_s, ends_s in pauses):
            for arm, session in zip(outputs.arms, team.arms, strict=True):
                for sample in arm.wrenches:
                    session.add_wrench(0, dataclasses.replace(sample, stamp_ns=STEADY_NS + sample.stamp_ns), now_ns)
                for slip in arm.slips:
                    session.add_slip(0, dataclasses.replace(slip, stamp_ns=STEADY_NS + slip.stamp_ns), now_ns)
            for arm, session in zip(outputs.arms, team.arms, strict=True):
                joint = dataclasses.replace(arm.joint, stamp_ns=STEADY_NS + arm.joint.stamp_ns)
                session.add_joint(joint, now_ns)
                for side, result in enumerate(team.cycle(now_ns)):
                    if result is not None:
                        stamp_ns = result.command.stamp_ns - STEADY_NS
                        newest[side] = dataclasses.replace(result.command, stamp_ns=stamp_ns)
        bridge.advance(newest)
    return max(speeds), max(speeds[-round(LAST_S * rate_hz) :])
