"""Every mistake on the command line is one clear line and exit code 2, before anything is started or written."""

from __future__ import annotations

from pathlib import Path

import pytest

from slip_description import urdf_text
from slip_vic.cli import main
from slip_vic.presets import preset_text

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
    "no parameter file": (["--params", "nowhere.yaml"], ["file nowhere.yaml: got No such file or directory, expected"]),
    "another node": (["--params", "bridge.yaml"], ["bridge.yaml", "/**/slip_sim_bridge", "slip_vic_controller"]),
    "parameter file with an empty name": (["--params", "empty.yaml"], ["empty.yaml", "got parameters of ['', '/**']"]),
    "parameter file with a name twice": (["--params", "twice.yaml"], ["twice.yaml: gains.k_s: got two values"]),
    "parameter file of two nodes": (["--params", "two.yaml"], ["two.yaml", "got parameters of ['/**', '/**/slip_vic"]),
    "parameter file with no values": (["--params", "none.yaml"], ["none.yaml", "expected one mapping"]),
    "sensor of a study": (["study", "--sensor", "vision_26"], ["vision_25"]),
    "mismatch of a study": (["study", "--mismatch", "mass"], ["mass+"]),
    "lottery with a sensor": (["study", "--lottery", "1", "--sensor", "ideal"], ["takes no --sensor"]),
    "mismatch of a search": (["tune", "--mismatch", "mass"], ["mass+"]),
    "joints that are no list": (["--scenario", "joints.yaml", "--drive", "torque_joint"], ["joint_names: got 5"]),
    "bytes": (["--set", "object.mass=\udcff"], ["--set object.mass: got \\udcff"]),
    "contact that is no list": (["--set", "contacts.position=5"], ["contacts.position: got 5"]),
    "stiffness that is no list": (["--scenario", "soft.yaml"], ["gains.stiffness: got soft"]),
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
    (tmp_path / "twice.yaml").write_text("gains: {k_s: 1.0}\ngains.k_s: 2.0")
    (tmp_path / "two.yaml").write_text("/**: {ros__parameters: {}}\n/**/slip_vic_controller: {ros__parameters: {}}")
    (tmp_path / "empty.yaml").write_text("'': 1\n/**: {ros__parameters: {}}")
    (tmp_path / "none.yaml").write_text("/**: {ros__parameters: }")
    text = preset_text("scenarios", "pane_two_arms_flat")
    (tmp_path / "joints.yaml").write_text(text.replace("joint_names: [", "joint_names: 5 # ["))
    (tmp_path / "soft.yaml").write_text(text.replace("stiffness: [5.0", "stiffness: soft # ["))
    (tmp_path / "taken").mkdir()
    return tmp_path


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_line_and_exit_code_2(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments, words = MISTAKES[name]
    before = sorted(folder.iterdir())
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.argv", ["slip-vic", *([] if arguments[0].isalpha() else ["run"]), *arguments])
    capsys.readouterr()
    assert main() == 2
    told = capsys.readouterr().err
    lines = [line for line in told.splitlines() if line.strip()]
    assert len(lines) == 1, told
    assert lines[0].startswith("error: ")
    assert all(word in lines[0] for word in words), lines[0]
    assert sorted(folder.iterdir()) == before
