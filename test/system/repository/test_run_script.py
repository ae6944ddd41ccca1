"""`./run` on a machine that lacks something: one clear line, exit code 2."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@pytest.fixture
def bare(tmp_path: Path) -> Path:
    """A copy of the entry script and what it reads, with a PATH that has no Python."""
    copy = tmp_path / "copy"
    copy.mkdir()
    shutil.copy(ROOT / "run", copy / "run")
    (copy / "requirements.lock").write_text("")
    (copy / "src").mkdir()
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("bash", "dirname", "cat", "cksum", "env", "rm", "ln"):
        found = shutil.which(name)
        assert found, name
        (tools / name).symlink_to(found)
    return copy


def run(copy: Path, **extra: str) -> subprocess.CompletedProcess[str]:
    environment = {"PATH": str(copy.parent / "bin"), "HOME": os.environ.get("HOME", "/"), **extra}
    return subprocess.run(
        [str(copy / "run"), "demo"], env=environment, capture_output=True, text=True, timeout=150, check=False
    )


def fake_python(copy: Path, body: str) -> None:
    path = copy.parent / "bin" / "python3"
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)


@pytest.mark.parametrize("answer", ["", "exit 1"], ids=["no Python", "an old one"])
def test_without_a_python_that_fits(bare: Path, answer: str) -> None:
    """One that is too old says so when it is asked for its version."""
    if answer:
        fake_python(bare, answer)
    done = run(bare)
    assert done.returncode == 2
    assert "no Python 3.11, 3.12 or 3.13 found" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (bare / ".venv").exists()


def test_without_venv(bare: Path) -> None:
    fake_python(bare, 'case "$2" in *ensurepip*) exit 1;; *) exit 0;; esac')
    done = run(bare)
    assert done.returncode == 2
    assert "no venv module" in done.stderr
    assert "apt install python3-venv" in done.stderr
    assert not (bare / ".venv").exists()
