"""The wheel: built from a copy, installed in an environment with nothing else, and run from an empty folder."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
import time
from importlib.machinery import ExtensionFileLoader, ModuleSpec
from pathlib import Path

import numpy as np
import pytest

from slip_native.header import header
from slip_vic_controller.law.bounds import stiffness_limit
from slip_vic_controller.law.gains import make_law_gains
from slip_vic_controller.params.controller_params import ControllerParams
from slip_vic_controller.session.arrival import ramp_to
from slip_vic_controller.state import ARM_SIZE
from tools.wheel import build_kernels

pytestmark = pytest.mark.long

ROOT = Path(__file__).parents[3]
LIMIT_S = 1500.0
DEADLINE_S = 600.0
# Benchmarks, another's timing, and two arms on one object: compiled where they are first made, in the parent of the
# processes.
NOT_IN_A_RUN = (
    "test.campaigns.", "slip_vic_controller.path.retiming", "slip_sim_bridge.plant.elastic",
    "tools.real_data.soft_grasp",
)  # fmt: skip


def environment(venv: Path) -> dict[str, str]:
    """Return an environment in which only the scratch one is found, as in a new shell of a user."""
    kept = {name: value for name, value in os.environ.items() if name in ("HOME", "LANG", "SSL_CERT_FILE")}
    kept |= {name: value for name, value in os.environ.items() if name.lower().startswith(("pip_", "http", "no_proxy"))}
    return {**kept, "PATH": f"{venv / 'bin'}:/usr/bin:/bin"}


@pytest.fixture(scope="module")
def venv(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Skips where pip can get neither what builds the wheel nor what it needs."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run([sys.executable, ROOT / "tools" / "wheel.py", folder], check=True, timeout=LIMIT_S)
    (wheel,) = folder.glob("slip_vic-*.whl")
    subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True, timeout=DEADLINE_S)
    pip = [folder / "venv" / "bin" / "python", "-m", "pip", "--disable-pip-version-check", "-q", "install"]
    done = subprocess.run(
        [*pip, f"{wheel}[ros]"],
        env=environment(folder / "venv"), capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip
    if done.returncode != 0 and "Could not find a version" in done.stderr:
        pytest.skip(f"pip has no way to the packages: {done.stderr.splitlines()[-1]}")
    assert done.returncode == 0, done.stderr
    return folder / "venv"


def slip_vic(venv: Path, folder: Path, *arguments: str, hidden: str = "") -> str:
    done = subprocess.run(
        [venv / "bin" / "slip-vic", *arguments],
        cwd=folder, env=environment(venv) | {"PYTHONPATH": hidden}, capture_output=True, text=True, timeout=DEADLINE_S,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def compiled() -> set[str]:
    """Return the modules with compiled entries."""
    found = set()
    for path in (ROOT / "src").glob("*/*/**/*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef) and any("kernel" in ast.unparse(one) for one in node.decorator_list):
                found.add(".".join(path.relative_to(ROOT / "src").with_suffix("").parts[1:]).removesuffix(".__init__"))
    return found


def kernels() -> set[str]:
    """Return those that a run with one arm needs."""
    return {name for name in compiled() if not name.startswith(NOT_IN_A_RUN)}


def test_preparing_imports_every_module_that_is_compiled() -> None:
    program = "import sys; from slip_vic.run.prepare import prepare; prepare(); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert len(kernels()) > 5
    assert kernels() - set(done.stdout.split()) == set()


def test_kernels_of_a_wheel_refuse_what_numba_refuses(tmp_path: Path) -> None:
    build_kernels(tmp_path / "kernels.so", {"limit": stiffness_limit, "ramp": ramp_to})
    loader = ExtensionFileLoader("kernels", str(tmp_path / "kernels.so"))
    kernels = loader.create_module(ModuleSpec("kernels", loader, origin=loader.path))
    loader.exec_module(kernels)
    assert kernels.limit(5, np.float64(1.0), 0.01) == stiffness_limit(5.0, 1.0, 0.01)
    state, target = np.zeros(ARM_SIZE), make_law_gains(ControllerParams(), 1.0)
    target.setflags(write=False)
    arrays = (target, None, state.astype("f4"), state.view("i8"), state[::2], state[:, None])
    for kernel, given in [
        (kernels.limit, (5.0, 1.0)), (kernels.limit, (5.0, "1.0", 0.01)), (kernels.ramp, (state, target, 1.0)),
        (kernels.ramp, (state, target, 2**63)), *((kernels.ramp, (array, target, 1)) for array in arrays),
    ]:  # fmt: skip
        with pytest.raises(TypeError, match=r"got .*, expected"):
            kernel(*given)
    assert not state.any()
    kernels.ramp(state, target, 1)
    assert state.any()


@pytest.mark.timeout(2 * LIMIT_S)
def test_the_wheel_runs_where_nothing_else_is(venv: Path, tmp_path: Path) -> None:
    assert "holds" in slip_vic(venv, tmp_path, "check", "--mismatch", "none")
    site = next((venv / "lib").glob("python*/site-packages"))
    began = time.time()
    hidden = tmp_path / "hidden"
    hidden.mkdir()
    (hidden / "numba.py").write_text("raise ImportError")  # machine code comes with the wheel
    assert "1000 ticks" in slip_vic(
        venv, tmp_path, "run", "--set", "bridge.duration_s=1.0", "--record", "bag", hidden=str(hidden)
    )
    assert "identical" in slip_vic(venv, tmp_path, "bag", "verify", "bag", hidden=str(hidden))
    assert "libslip_vic.so" in slip_vic(venv, tmp_path, "export", "-o", "native", hidden=str(hidden))
    assert (tmp_path / "native" / "slip_vic.h").read_text() == header()
    # Into the folder of the user, and not beside the installed packages.
    files = [path for path in site.glob("slip_*/**/*") if path.is_file() and "__pycache__" not in path.parts]
    assert [path for path in files if path.stat().st_mtime > began] == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bag", "hidden", "native"]
