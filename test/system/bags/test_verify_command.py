"""`bag verify` as a command, which asks git for the revision; of runs over DDS; in a process that has no ROS."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from slip_bags.reader import Bag
from slip_vic.cli import bag as bag_command
from slip_vic.replay.run_data import read_run
from slip_vic.replay.verify import other_software, verify_run
from slip_vic.scenarios.scenario import load
from test.support.run_maker import attachments, record_run

BAGS = Path(__file__).parents[3] / "bags"


@pytest.mark.parametrize("name", ["noisy_run", "real_time_run"])
def test_runs_over_dds_are_identical(name, request):
    """Recorded by the launcher; in real time the order of arrival is known from the ledger alone."""
    bag = Bag(request.getfixturevalue(name).bag)
    found = verify_run(read_run(bag))
    assert found.identical, found.text()
    assert found.cycles > 0


@pytest.mark.smoke
def test_command_and_exit_codes(tmp_path):
    good = CliRunner().invoke(bag_command, ["verify", str(BAGS / "tare_pushed")])
    assert (good.exit_code, good.stdout) == (0, "identical: 75 cycles, 504 efforts, to the last bit\n")
    slips = "bridge.duration_s=0.6"
    runs, other = (load("paper_planar", law="vic", set=(slips, f"controller.gains.gamma_kp={k}")) for k in (100, 99))
    record_run(tmp_path / "other", runs, attached=attachments(other))
    bad = CliRunner().invoke(bag_command, ["verify", str(tmp_path / "other")])
    assert bad.exit_code == 1
    assert "effort_command, arm_joint" in bad.stdout


def on_another_processor(*command: str) -> str:
    """Return what Python prints where libraries choose their loops for an old processor."""
    env = {**os.environ, "OPENBLAS_CORETYPE": "Prescott"}
    if platform.machine() == "x86_64":
        env["NPY_DISABLE_CPU_FEATURES"] = "X86_V3"
    done = subprocess.run([sys.executable, *command], capture_output=True, text=True, check=False, env=env)
    return done.stdout + done.stderr


@pytest.mark.smoke
def test_bags_verify_on_another_processor():
    """Libraries choose their loops by the processor; nothing that a replay depends on may be left to them."""
    for name in ("governed_joint_torques", "two_arms_governed"):
        said = on_another_processor("-m", "slip_vic.cli", "bag", "verify", str(BAGS / name))
        assert "identical" in said, said


@pytest.mark.smoke
def test_attitudes_are_the_same_bits_on_another_processor():
    """Of contacts, references, goals and displacements."""
    code = (
        "import zlib; import numpy as np; from slip_core.arrays import matrix_from_quat_xyzw\n"
        "dice = np.random.default_rng(1)\n"
        "print(zlib.crc32(b''.join(matrix_from_quat_xyzw(dice.normal(size=4)).tobytes() for _ in range(1000))))"
    )
    here = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert on_another_processor("-c", code) == here


def test_other_software_is_named():
    notes = other_software({"git_revision": "abacus", "numpy": "0.1"})
    assert notes[0].startswith("recorded with git_revision abacus")
    assert "numpy 0.1" in notes[1]
