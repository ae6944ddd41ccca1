"""Every command in a block of a page runs, in the order shown; one that takes minutes is tried by a test of its own.

In this process, but for what goes over DDS: to record and to play.
"""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner

from slip_vic.cli import cli
from test.support.command import DEADLINE_S, slip_vic
from test.support.pages import OURS, PAGES, commands_of

# The demo, the checks themselves and the long measurements have tests of their own; a recording ends with Ctrl-C.
ELSEWHERE = ("test", "demo", "bench", "benchmark", "study", "tune", "faults", "soak", "bringup", "bag record")
# These stand for something: a bag of the reader's, a module of his, an option without its value.
EXAMPLES = (
    "path.csv",
    "waypoints.csv",
    "my_sensor.yaml",
    "my_bag",
    "my_arm.yaml",
    "ARM.urdf",
    "ARM.urdf.xacro",
    "ur5_robot.urdf",
    "native_sim",
    "native_bag",
    "so101_new_calib.urdf",
    "so101",
    "urdf",
    "measured.yaml",
    "BAG",
    "DIR",
    "FOLDER",
    "...",
    "--speed",
)
# Real time, files of the repository, what ends with Ctrl-C.
NEEDS_MORE = ("--mode realtime", "--out docs", "--loop")
# What a page takes as given before its first command: bags of runs.
BAGS = Path(__file__).parents[3] / "bags"
GIVEN = {
    "bags.md": {
        "out/classical": "paper_planar_classical",
        "out/vic": "paper_planar_vic",
        "out/killed": "paper_planar_vic",
    }
}


def to_run(page: Path) -> list[str]:
    """Return what is run of a page: commands of ours that are complete and not tried elsewhere, each once."""
    found = [shlex.join(words[1:]) for words in commands_of(page, inline=False) if words[0] in OURS and len(words) > 2]
    return [
        command
        for command in dict.fromkeys(found)
        if not command.startswith(ELSEWHERE) and not any(word.partition("/")[0] in EXAMPLES for word in command.split())
        and not any(part in command for part in NEEDS_MORE)
    ]  # fmt: skip


def of_pages() -> dict[str, list[str]]:
    """Return what is run of each page; what needs no files of its page, once of all."""
    found, known = dict[str, list[str]](), set[str]()
    for page in PAGES:
        found[page.name] = [command for command in to_run(page) if command not in known or "out/" in command]
        known.update(found[page.name])
    return found


RUN = of_pages()


def shortened(command: str) -> str:
    """Return a command with less to do: that it runs is shown here, what it shows elsewhere."""
    if command.startswith("run "):
        command += " --set bridge.duration_s=0.8"
        command += "" if {"--record", "--in-process"} & set(command.split()) else " --in-process"
    if command.startswith("check "):
        command += " --mismatch none"
    return command.replace("--rate 0.5", "--rate 5")


def over_dds(command: str) -> bool:
    return "--record" in command or command.startswith("bag play")


@pytest.mark.timeout(DEADLINE_S * 2)
@pytest.mark.parametrize("page", [name for name, commands in RUN.items() if commands])
def test_the_commands_of_a_page_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the order shown, in one folder: later ones may use what earlier ones made."""
    monkeypatch.chdir(tmp_path)
    Path("out").mkdir()
    Path("examples").symlink_to(BAGS.parent / "examples")
    for name, bag in GIVEN.get(page, {}).items():
        shutil.copytree(BAGS / bag, name)
    Path("out/killed/metadata.yaml").unlink(missing_ok=True)
    for command in map(shortened, RUN[page]):
        if over_dds(command):
            done = slip_vic(*shlex.split(command), folder=tmp_path)
            assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
        else:
            result = CliRunner().invoke(cli, shlex.split(command))
            assert result.exit_code == 0, f"{command}: {result.output}{result.exception!r}"


def test_there_is_something_to_run() -> None:
    assert len(RUN["README.md"]) >= 5
    assert len(RUN["bags.md"]) >= 5
    assert RUN["sensors.md"]
