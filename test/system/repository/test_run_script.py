"""`./run` on a machine that lacks something: one clear line, exit code 2."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
BY_FILE = "--dist loadfile --no-loadscope-reorder"
FAST = f"-q test/unit -n auto {BY_FILE}"


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


def test_without_python(bare: Path) -> None:
    done = run(bare)
    assert done.returncode == 2
    assert "no Python 3.11, 3.12 or 3.13 found" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (bare / ".venv").exists()


def test_with_an_old_python_only(bare: Path) -> None:
    fake_python(bare, "exit 1")  # answers "no" to the version question
    done = run(bare)
    assert done.returncode == 2
    assert "no Python 3.11, 3.12 or 3.13 found" in done.stderr


def test_without_venv(bare: Path) -> None:
    fake_python(bare, 'case "$2" in *ensurepip*) exit 1;; *) exit 0;; esac')
    done = run(bare)
    assert done.returncode == 2
    assert "no venv module" in done.stderr
    assert "apt install python3-venv" in done.stderr
    assert not (bare / ".venv").exists()


ALONE = [f"test/system/bringup/test_{name}.py" for name in ("demo", "page")]


@pytest.fixture
def called(tmp_path: Path) -> dict[str, str]:
    """An environment in which every checker prints its name and arguments, and does nothing else."""
    for name in ("ruff", "mypy", "python"):
        (tmp_path / name).write_text(f'#!/bin/sh\necho "called {name} $*"\n')
        (tmp_path / name).chmod(0o755)
    return {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}


@pytest.mark.parametrize(
    ("arguments", "calls"),
    [
        (
            (),
            [
                "ruff format --check .",
                "ruff check .",
                "mypy ",
                f"python -m pytest {FAST}",
                f"python -m pytest test/referees test/system -m smoke or referee and not long -n 2 {BY_FILE}",
            ],
        ),
        (
            ("--all",),
            [
                "ruff format --check .",
                "ruff check .",
                "mypy ",
                f"python -m pytest {FAST}",
                f"python -m pytest test/referees test/system -n 4 {BY_FILE} "
                + " ".join(f"--ignore={path}" for path in ALONE),
                f"python -m pytest {' '.join(ALONE)}",
            ],
        ),
        (("-k", "law"), ["ruff format --check .", "ruff check .", "mypy ", "python -m pytest -k law"]),
        (("--fast",), [f"python -m pytest {FAST}"]),
        (("--fast", "-x"), [f"python -m pytest {FAST} -x"]),
    ],
)
def test_the_checks_of_each_tier(called: dict[str, str], arguments: tuple[str, ...], calls: list[str]) -> None:
    done = subprocess.run(
        [ROOT / "tools" / "check", *arguments], env=called, capture_output=True, text=True, timeout=150, check=True
    )
    found = [line.removeprefix("called ") for line in done.stdout.splitlines() if line.startswith("called ")]
    compiles = [line for line in found if "prepare()" in line]  # beside the first checks, in any order with them
    assert len(compiles) == 1
    assert [line.strip() for line in found if line not in compiles] == [line.strip() for line in calls]
