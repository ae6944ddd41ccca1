"""`check` says what will hold before anything moves, and says "holds" of nothing that it has not run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from slip_vic.cli import cli
from slip_vic.scenarios.scenario import load
from slip_vic_controller.config.controller import ArmController

BRIEF = ("--mismatch", "none", "--set", "bridge.duration_s=0.05")


def check(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(cli, ["check", *words])
    return done.exit_code, " ".join(done.output.split())


def test_an_infeasible_path_is_refused_with_its_place() -> None:
    less = ("--mismatch", "none", "--set", "bridge.duration_s=1.0")
    code, words = check("--scenario", "vertical_plane", "--set", "controller.governor.margin=0.95", *less)
    assert code == 2
    assert "refused: UNREACHABLE" in words
    assert "at 800 ms of the path" in words


def test_it_says_holds_only_of_what_it_has_run() -> None:
    code, words = check("--scenario", "vertical_plane", "--mismatch", "friction-", "--set", "bridge.duration_s=1.0")
    assert code == 1
    assert "holds in 1 of 2 simulated worlds" in words
    assert "friction-: " in words
    code, words = check("--mismatch", "none", "--set", "bridge.duration_s=4.5")
    assert code == 0, words
    assert "holds in 1 of 1 simulated worlds" in words
    code, words = check("--mismatch", "none", "--set", "bridge.duration_s=1.5")
    assert code == 1
    assert "none: does not arrive: ends" in words


@pytest.mark.parametrize("command", ["check", "run"])
def test_two_contacts_are_refused_in_one_line(command: str) -> None:
    two = [
        "contacts.position=[0.02, 0.0, 0.0, -0.02, 0.0, 0.0]",
        "contacts.orientation_xyzw=[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]",
        f"contacts.slip_axes={[True, True, False, False, False, True] * 2}",
    ]
    done = CliRunner().invoke(cli, [command, *(word for assignment in two for word in ("--set", assignment))])
    assert "got 2 contacts, expected one for each arm, 1" in str(done.exception)


def test_a_wrist_without_inertia_is_refused_before_it_moves(tmp_path: Path) -> None:
    """M_D may be as many times the inertia that a joint moves as of a tenth of the object's: 0.3 / 2e-4."""
    before, of, wrist = load("paper_planar", law="vic").urdf.partition('name="arm_joint7"')
    for name, value in (("i(xx|yy|zz)", "1e-7"), ("i(xy|xz|yz)", "0"), ("(mass value)", "1e-3")):
        wrist = re.sub(rf'{name}="[^"]*"', lambda found, to=value: found[0].split("=")[0] + f'="{to}"', wrist)
    (tmp_path / "light.urdf").write_text(before + of + wrist)
    arm = f"robot_description_file={tmp_path / 'light.urdf'}"
    words = ("--set", arm, *BRIEF)
    code, said = check(*words)
    assert code == 2
    assert "M_D over the inertia of arm_joint7 fails" in said
    assert "limit 1500" in said
    loaded = load("paper_planar", law="vic", set=[arm])
    wrist = ArmController(loaded.controller, loaded.placed[""], lockstep=True).wrist  # what the node reports at start
    assert (wrist.holds, wrist.line in said) == (False, True)
    code, said = check(*words, "--set", "drive.armature=[0.001]")
    assert "M_D over the inertia of arm_joint7 holds: 299." in said


def test_the_bound_on_k_s_and_the_exit_code() -> None:
    words = ("--sensor", "optical_flow_120", "--set", "controller.slip_estimator=measured")
    file = Path(__file__).parents[3] / "config/paper_planar/controller_vic.yaml"
    for more, code, part in (
        (("--set", "controller.gains.k_s=0.5"), 2, "fails"), (BRIEF, 1, "does not arrive"),
        ((*BRIEF, "--params", str(file)), 1, "54.8861"),
    ):  # fmt: skip
        found, said = check(*words, *more)
        assert (found, part in said) == (code, True), said
