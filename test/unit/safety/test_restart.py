"""A controller that goes on after a pause, or starts anew in motion, begins at what the joints feel."""

from __future__ import annotations

import numpy as np
import pytest

from slip_core.types import JointSample
from slip_sim_bridge.session import BridgeSession
from test.campaigns.faults.plan import BRIDGE, CONTROLLER, JOINT, SLIP, WRENCH, Plan, make_plan
from test.campaigns.faults.plan import Fault as Planned
from test.campaigns.faults.trial import PERIOD_S, START_NS, STEADY_NS, prepared, run_trial
from test.support.one_arm import OneArm

ROUNDING = 1e-9  # [N m]
STEP = PERIOD_S * 1000.0  # [N m]: what the default slope allows in a control period


class Loop:
    """Bridge and controller without topics, by virtual steady time."""

    def __init__(self) -> None:
        scenario, self.law = prepared("paper_planar", True, "vic")
        assert scenario.controller.safety.limits.effort_rate * PERIOD_S == STEP
        self.bridge = BridgeSession(scenario.bridges, scenario.urdfs)
        self.bridge.start_at(START_NS)
        self.controller = OneArm(self.law)
        self.now_ns = STEADY_NS
        self.effort = np.zeros(0)

    def observe(self) -> JointSample:
        """Deliver all samples but the joint state, which is returned."""
        (sent,) = self.bridge.observe().arms
        for wrench in sent.wrenches:
            self.controller.add_wrench(0, wrench, self.now_ns)
        for slip in sent.slips:
            self.controller.add_slip(0, slip, self.now_ns)
        return sent.joint

    def cycle(self, joint: JointSample) -> np.ndarray:
        """Answer a joint state, advance the bridge, and return the effort."""
        self.controller.add_joint(joint, self.now_ns)
        result = self.controller.cycle(self.now_ns)
        assert result is not None
        self.bridge.advance([result.command])
        self.now_ns += round(1e9 * PERIOD_S)
        return result.command.numbers


def test_restart_in_motion_makes_no_step() -> None:
    """The new controller knows nothing; its first command differs from the last one by no more than one step."""
    loop = Loop()
    before = [loop.cycle(loop.observe()) for _ in range(150)][-1]
    joint = loop.observe()
    assert np.abs(joint.velocity).max() > 0.05, "the arm must move for this test to mean something"
    loop.bridge.advance([None])
    loop.controller = OneArm(loop.law)
    efforts = []
    for _ in range(50):
        joint = loop.observe()
        effort = loop.cycle(joint)
        if len(effort):
            start = joint.effort if not efforts else efforts[-1]
            assert np.abs(effort - start).max() <= STEP + ROUNDING
            efforts.append(effort)
    assert len(efforts) > 40
    assert np.abs(efforts[0] - before).max() <= 3 * STEP  # the bridge held for two ticks in between


def test_law_resumes_after_stall() -> None:
    """Nodes that a loaded machine does not run for a while, and inputs that stay away as long."""
    resumes_s = prepared("vertical_plane", False, "governed")[0].controller.safety.resume_after_s
    for kind, target in (("stop", CONTROLLER), ("stop", BRIDGE), ("drop", JOINT), ("drop", WRENCH), ("drop", SLIP)):
        for stall_s in (0.06, 0.2):
            stall = Planned(kind, target, 0.4, stall_s, 0.9)
            outcome = run_trial(Plan(0, 1, "vertical_plane", False, "governed", (stall,)))
            assert outcome.violations == (), stall
            assert outcome.modes["DEGRADED" if target == WRENCH else "HOLD"] > 0 or target == SLIP, stall
            assert outcome.recovery_s is not None, stall
            assert outcome.recovery_s < resumes_s + 3 * PERIOD_S, stall


@pytest.mark.parametrize("trial", [826, 856])
def test_limiter_restarts_after_a_cycle_without_a_command(trial: int) -> None:
    """A clock that jumps back: no command for a cycle, and then none that steps by the time of the pause."""
    plan = make_plan(20261201, trial)
    assert "clock_jump" in {fault.kind for fault in plan.faults}
    assert run_trial(plan).violations == ()
