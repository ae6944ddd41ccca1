"""Every mistake on the command line is one clear line and exit code 2, before anything is started or written."""

from __future__ import annotations

from pathlib import Path

import pytest

from slip_description import urdf_text
from slip_vic.cli import main

URDF_WITHOUT_EE = urdf_text().replace('"ee"', '"tip"')

MISTAKES = {
    "unknown scenario": (["--scenario", "paper_plane"], ["paper_plane", "did you mean paper_planar"]),
    "unknown parameter": (["--set", "controller.gains.ks=1"], ["controller.gains.ks", "controller.gains.k_s"]),
    "unknown shared parameter": (["--set", "object.mas=1"], ["object.mas", "object.mass"]),
    "no value": (["--set", "object.mass"], ["key=value"]),
    "domain out of range": (["--domain-id", "500"], ["ROS_DOMAIN_ID", "500"]),
    "namespace that ROS refuses": (["--namespace", "a b"], ["--namespace a b", "letters, digits"]),
    "controller unknown": (["--law", "pid"], ["pid", "did you mean printed"]),
    "urdf missing": (["--set", "robot_description_file=nowhere.urdf"], ["nowhere.urdf"]),
    "urdf without the frame": (["--set", "robot_description_file=tip.urdf"], ["ee_frame", "link of the URDF", "tip"]),
    "start beyond a limit": (
        ["--set", "bridge.initial_position=[0, 0, 0, 1.0, 0, 1, 0]"],
        ["arm_joint4", "limits", "slip-vic arm"],
    ),
    "start in a singular posture": (["--set", "controller.singularity.sigma_min=0.5"], ["singular", "sigma_min"]),
    "path out of reach": (["--set", "controller.trajectory.displacement=[0, 0, 2]"], ["trajectory", "% of its time"]),
    "urdf is not xml": (["--set", "robot_description_file=broken.urdf"], ["robot_description", "URDF"]),
    "scenario file is not yaml": (["--scenario", "broken.yaml"], ["broken.yaml, line 2", "a tab"]),
    "scenario file with an unknown key": (["--scenario", "extra.yaml"], ["unknown name", "did you mean duration_s"]),
    "parameter file missing": (
        ["--params", "nowhere.yaml"],
        ["file nowhere.yaml: got No such file or directory, expected"],
    ),
    "parameter file of another node": (
        ["--params", "bridge.yaml"],
        ["bridge.yaml", "/**/slip_sim_bridge", "slip_vic_controller"],
    ),
    "bag folder exists": (["--record", "taken"], ["taken", "exists"]),
    "bag folder cannot be written": (["--record", "/proc/bag"], ["/proc"]),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "tip.urdf").write_text(URDF_WITHOUT_EE)
    (tmp_path / "broken.urdf").write_text("<robot")
    (tmp_path / "broken.yaml").write_text("a:\n\tb: 1")
    (tmp_path / "bridge.yaml").write_text("/**/slip_sim_bridge: {ros__parameters: {friction: {mu_s: 0.4}}}")
    (tmp_path / "extra.yaml").write_text("name: a\ndescription: b\ndurration_s: 1\n")
    (tmp_path / "taken").mkdir()
    return tmp_path


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_line_and_exit_code_2(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments, words = MISTAKES[name]
    before = sorted(folder.iterdir())
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.argv", ["slip-vic", "run", *arguments])
    capsys.readouterr()
    assert main() == 2
    told = capsys.readouterr().err
    lines = [line for line in told.splitlines() if line.strip()]
    assert len(lines) == 1, told
    assert lines[0].startswith("error: ")
    assert all(word in lines[0] for word in words), lines[0]
    assert sorted(folder.iterdir()) == before
