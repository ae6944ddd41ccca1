"""Two arms on one object: an input of one that falls silent stops both, at the same time."""

from __future__ import annotations

from collections import Counter

import pytest

from slip_core.types import JointCommand
from slip_sim_bridge.session import BridgeSession
from slip_vic.scenarios.scenario import load
from slip_vic_controller.config.controller import Controller
from slip_vic_controller.session.session import ControllerSession

PERIOD_S = 0.004


@pytest.mark.parametrize(("topic", "mode"), [("joint", "HOLD"), ("wrench", "DEGRADED"), ("slip", "DEGRADED")])
def test_silent_input_stops_both(topic: str, mode: str) -> None:
    """Without wrench or slip velocity of one arm both come to rest along the path first."""
    assignments = (
        f"control_period_s={PERIOD_S}", "controller.gains.k_s=100.0", "controller.gains.kappa=0.4",
        "controller.trajectory.start_s=0.0", "controller.trajectory.duration_s=1.2",
    )  # fmt: skip
    scenario = load("pane_two_arms_upright", law="vic", mode="realtime", set=assignments)
    bridge = BridgeSession(scenario.bridges, scenario.urdfs)
    session = ControllerSession(Controller(scenario.controllers, scenario.placed, lockstep=False))
    commands: list[JointCommand | None] = [None, None]
    modes, apart = Counter[str](), 0
    for tick in range(round(0.9 / PERIOD_S)):
        now_ns, outputs, silent = round(1e9 * (5.0 + tick * PERIOD_S)), bridge.observe(), tick * PERIOD_S > 0.2
        answers = []
        for k, (arm, sent) in enumerate(zip(session.arms, outputs.arms, strict=True)):
            absent = topic if silent and k == 1 else ""
            for wrench in sent.wrenches if absent != "wrench" else ():
                arm.add_wrench(0, wrench, now_ns)
            for slip in sent.slips if absent != "slip" else ():
                arm.add_slip(0, slip, now_ns)
            if absent != "joint":
                arm.add_joint(sent.joint, now_ns)
                answers.append(session.cycle(now_ns))
        for results in (*answers, session.watchdog(now_ns)):
            assert len(results) == len(commands)
            for k, result in enumerate(results):
                if result is not None:
                    modes[result.mode.name] += 1
                    commands[k] = result.command
        follows = {arm.mode.follows for arm in session.arms}
        apart = apart + 1 if len(follows) > 1 else 0
        assert apart < 2, "one arm follows the law while the other one holds"
        bridge.advance(commands)
    assert modes["ACTIVE"] > 20
    assert modes[mode] > 20
