"""An export of the cycle, with its example and node compiled: made once in a session."""

from __future__ import annotations

import subprocess
import sysconfig
from pathlib import Path

import pytest
from click.testing import CliRunner

from slip_vic.cli import cli

SHORT = "bridge.duration_s=0.5"


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as the command writes it."""
    folder = tmp_path_factory.mktemp("native") / "out"
    done = CliRunner().invoke(cli, ["export", "--set", SHORT, "--out", str(folder)])
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture(scope="session")
def built(library: Path) -> Path:
    """The same with all that cmake makes of it."""
    site = Path(sysconfig.get_path("purelib"))
    prefixes = f"-DCMAKE_PREFIX_PATH={sysconfig.get_path('data')};{site / 'cmeel.prefix'}"
    call("cmake", "-S", ".", "-B", "build", prefixes, cwd=library)
    call("cmake", "--build", "build", cwd=library)
    return library


def call(*command: str | Path, cwd: Path) -> str:
    """Return what a command has printed; it must not fail."""
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr
