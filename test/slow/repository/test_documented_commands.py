"""Every command that a page shows runs."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

from slip_bringup.processes import child_environment

ROOT = Path(__file__).parents[3]


DEADLINE_S = 300.0


ELSEWHERE = ("test", "demo", "bench", "study", "faults", "soak")


def shown_commands() -> list[str]:
    found = []
    for block in re.findall(r"```bash\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.S):
        for line in block.splitlines():
            words = shlex.split(line, comments=True)
            if words[:1] == ["./run"] and words[1] not in ELSEWHERE:
                found.append(shlex.join(words[1:]))
    return found


def test_the_readme_shows_the_two_commands_first() -> None:
    first = re.search(r"```bash\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.S)
    assert first
    assert [line.split()[:2] for line in first.group(1).splitlines()] == [["./run", "demo"], ["./run", "test"]]


def test_the_commands_of_the_readme_run(tmp_path: Path) -> None:
    """In the order shown, in one folder: later ones may use what earlier ones made."""
    environment = child_environment(0)
    del environment["ROS_DOMAIN_ID"], environment["SLIP_VIC_EVENTS"]
    (tmp_path / "out").mkdir()
    commands = shown_commands()
    assert len(commands) >= 4
    for command in commands:
        done = subprocess.run(
            [sys.executable, "-m", "slip_bringup.cli", *shlex.split(command)],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=False,
        )
        assert done.returncode == 0, f"{command}: {done.stderr}"
