"""An arm made of its URDF alone carries the object as the suite's own does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.scenario import Law, load_scenario
from slip_vic.setup.arm import posture
from slip_vic.setup.arm.write import Arm, write_arm
from test.support.odd_arm import odd_arm_urdf

pytestmark = pytest.mark.long

BETTER = 20.0
SLIPS_M = 0.01
AFTER_THE_MOTION = "bridge.duration_s=3.0"


def final_slip(scenario: str, controller: Law) -> np.ndarray:
    ticks = run_in_process(load_scenario(scenario, law=controller, assignments=[AFTER_THE_MOTION]))
    last = np.zeros(6)
    for tick in ticks:
        last = tick.outputs.truth.slip_displacement
    return np.array([np.linalg.norm(last[:3]), np.linalg.norm(last[3:])])


def test_a_six_joint_arm_slips_a_twentieth_of_classical(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(posture, "SAMPLES", 300)
    arm = Arm(odd_arm_urdf())
    content, _ = arm.task("paper_planar", 1.0)
    write_arm(arm, {"paper_planar": content}, tmp_path, Path("odd.urdf"))
    scenario = str(tmp_path / "paper_planar.yaml")
    classical, vic, governed = (final_slip(scenario, kind) for kind in ("classical", "vic", "governed"))
    assert classical[0] > SLIPS_M
    assert (BETTER * vic < classical).all()
    assert (BETTER * governed < classical).all()
