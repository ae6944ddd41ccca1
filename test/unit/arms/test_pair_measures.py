"""What a run with two arms is judged by, and what is left of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slip_sim_bridge.session import internal_wrenches
from slip_vic.page.runs import tip_of
from slip_vic.scenarios.scenario import load
from slip_vic_controller.robot import Robot

SHORT = ("left.bridge.duration_s=0.03", "right.bridge.duration_s=0.03")


def test_internal_wrenches_balance() -> None:
    rng = np.random.default_rng(4)
    places = [np.array([0.0, 0.2, 0.0]), np.array([0.0, -0.16, 0.03])]
    wrenches = list(rng.normal(size=(2, 6)))
    parts = internal_wrenches(wrenches, places, [np.eye(3)] * 2, np.zeros(3), 0.02)
    force = sum(part[:3] for part in parts)
    moment = sum(part[3:] + np.cross(x, part[:3]) for part, x in zip(parts, places, strict=True))
    np.testing.assert_allclose(np.concatenate((force, moment)), 0.0, atol=1e-12)
    assert max(np.abs(part).max() for part in parts) > 0.1


def test_run_has_both_arms(tmp_path: Path) -> None:
    run = load("pane_two_arms_upright", law="vic", set=SHORT).run()
    assert run.outcome == "ok"
    assert list(run.summary) == ["left", "right"]
    assert len(run.frame("right")) == 30
    assert 0.0 <= run.internal_force_n < 1e-3
    assert run.summary["left"]["load_peak"] == pytest.approx(0.8175, abs=1e-4)  # half of the weight, 4.905 of 6 N
    text = run.page(tmp_path / "run.html").read_text()
    assert "vic left" in text
    assert "vic right" in text
    data = run.data
    for arm in data.arms:
        tip = Robot(arm.urdf, tip_of(arm), arm.joint_names).frame(arm.channel("joints").rows[0])[0]  # on its base
        np.testing.assert_allclose(tip, arm.law_six("position")[0, :3], atol=1e-9)
