"""`slip-vic export`: C answers the runs of Python to the last bit, on a library that needs libm and nothing else."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from click.testing import CliRunner

from slip_native.functions import FUNCTIONS
from slip_vic.cli import cli
from slip_vic.scenarios.scenario import load
from slip_vic.setup.export import write_run
from test.system.native.conftest import call
from tools.reference_bags import REFERENCES

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
WARNINGS = ("-Wall", "-Wextra", "-Werror")


@pytest.fixture(scope="module")
def example(library: Path) -> Path:
    """The library with its example compiled."""
    call("cc", "-std=c11", "-O2", *WARNINGS, "example.c", "libslip_vic.a", "-lm", "-o", "example", cwd=library)
    return library


RUNS = {
    "an observer, estimated joints and a tare": (
        "paper_planar", "governed", {"sensor": "vision_60", "drive": "torque_joint"},
        ("controller.tare.duration_s=0.1",),
    ),
    "velocities, and a grip that follows": (
        "glass_transport", "governed", {"sensor": "optical_flow_120", "drive": "velocity_500"},
        ("controller.grip.control=follow", "bridge.grip.control=follow"),
    ),
    "displacements": ("vertical_plane", "vic", {"sensor": "event_1000"}, ("slip_input=displacement",)),
    "the printed law": ("paper_planar", "printed", {}, ()),
}  # fmt: skip
BAGS = {reference.name: reference for reference in REFERENCES}


@pytest.mark.parametrize("name", [*RUNS, *BAGS])
def test_example_answers_a_run_to_the_last_bit(example: Path, tmp_path: Path, name: str) -> None:
    if name in BAGS:
        loaded = BAGS[name].load()
    else:
        scenario, law, presets, more = RUNS[name]
        loaded = load(scenario, law=law, seed=3, set=("bridge.duration_s=1.5", *more), **presets)
    write_run(loaded, tmp_path)
    said = call(str(example / "example"), "run.bin", cwd=tmp_path)
    cycles, commands, differ, faults = map(int, re.findall(r"\d+", said))
    assert cycles >= min(round(one.duration_s / one.control_period_s) for one in loaded.bridges.values())
    assert commands > 0.5 * cycles
    assert (differ, faults) == (0, 0)


def test_example_sees_a_number_that_differs(example: Path, tmp_path: Path) -> None:
    data = bytearray((example / "run.bin").read_bytes())
    data[-8] ^= 1  # the last number of the last tick
    (tmp_path / "run.bin").write_bytes(data)
    done = subprocess.run([example / "example", "run.bin"], cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 1


def test_library_needs_nothing_but_arithmetic(library: Path) -> None:
    needed = {
        line.split()[-1].partition("@")[0]
        for line in call("nm", "-u", "libslip_vic.a", cwd=library).splitlines()
        if " U " in line
    }
    arithmetic = "atan2 erf exp hypot log log10 pow sincos tanh memcpy memset memmove"
    assert needed - {"_GLOBAL_OFFSET_TABLE_", "__tls_get_addr"} <= set(arithmetic.split())


def test_library_shows_the_functions_of_its_header_alone(library: Path) -> None:
    names = {
        line.split()[-1] for line in call("nm", "-D", "--defined-only", "libslip_vic.so", cwd=library).splitlines()
    }
    declared = set(re.findall(r"^\w+ (slip_vic_\w+)\(", (library / "slip_vic.h").read_text(), re.MULTILINE))
    assert names == declared == {one.__name__ for one in FUNCTIONS} | {"slip_vic_faults", "slip_vic_room_used"}


@pytest.mark.skipif(shutil.which("valgrind") is None, reason="no valgrind")
def test_memcheck_finds_nothing(example: Path) -> None:
    call("valgrind", "--error-exitcode=9", "--leak-check=full", "-q", str(example / "example"), "run.bin", cwd=example)


def test_missing_compiler_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    done = CliRunner().invoke(cli, ["export", "--out", str(tmp_path / "out")])
    assert done.exit_code != 0
    assert "got no cc or no objcopy" in str(done.exception or done.output)
