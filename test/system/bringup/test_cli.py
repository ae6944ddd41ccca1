"""The command line: every mistake is one clear line and exit code 2, and nothing is left half-written."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from mcap.writer import IndexType, Writer

from slip_msgs_py.stop_flag import held_back
from slip_vic.run.processes import child_environment
from test.support.command import plain_environment, slip_vic
from test.support.ros import wait_until

DEADLINE_S = 150.0  # a hang: every command takes seconds


def test_two_runs_need_not_know_of_each_other(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "slip_vic.cli", "run", "--set", "bridge.duration_s=0.2"]
    runs = [subprocess.Popen(command, env=plain_environment(), stdout=subprocess.PIPE, text=True) for _ in range(2)]
    outputs = [run.communicate(timeout=DEADLINE_S)[0] for run in runs]
    assert [run.returncode for run in runs] == [0, 0]
    assert all("\n200 ticks" in f"\n{output}" for output in outputs)


def mapped(process: subprocess.Popen[str], library: str) -> bool:
    return library in Path(f"/proc/{process.pid}/maps").read_text()


def nodes_of(process: subprocess.Popen[str]) -> int:
    return len(psutil.Process(process.pid).children())


MOMENTS = {
    "importing": lambda process: mapped(process, "pydantic_core"),
    "checking": lambda process: mapped(process, "libpinocchio"),
    "first process": lambda process: nodes_of(process) >= 1,
    "all processes": lambda process: nodes_of(process) == 3,
    "running": lambda process: nodes_of(process) == 3 and not time.sleep(3.0),
}


@pytest.mark.parametrize(
    ("command", "moment"),
    [
        ("run", "importing"), ("demo", "checking"), ("demo", "first process"), ("run", "all processes"),
        ("demo", "running"),
    ],
)  # fmt: skip
def test_ctrl_c_at_any_moment_leaves_nothing(command: str, moment: str, tmp_path: Path) -> None:
    marker = f"slip_ctrl_c_{os.getpid()}_{command}_{moment}"
    option = ["--set", "bridge.duration_s=1000.0"]
    option += ["--out", str(tmp_path / "out")] if command == "demo" else ["--record", str(tmp_path / "bag")]
    process = subprocess.Popen(
        [sys.executable, "-m", "slip_vic.cli", command, *option], env=plain_environment(SLIP_TEST_MARKER=marker),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        wait_until(lambda: MOMENTS[moment](process), moment, DEADLINE_S)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=DEADLINE_S)
    finally:
        process.kill()
    assert process.returncode == 2, errors
    assert [line for line in errors.splitlines() if line][-1].startswith("error: interrupted"), errors
    assert "Traceback" not in errors
    assert marked(marker) == []
    if command == "demo":
        assert not (tmp_path / "out").exists() or list((tmp_path / "out").iterdir()) == []
    elif (tmp_path / "bag").exists():
        assert (tmp_path / "bag" / "metadata.yaml").exists()


@pytest.mark.parametrize(
    "body",
    [
        "exec('signal.raise_signal(signal.SIGINT)')",
        "with contextlib.suppress(KeyboardInterrupt): signal.raise_signal(signal.SIGINT)\n    raise ImportError",
    ],
    ids=["within a text that is executed, as dataclasses are", "within a library that says something else of it"],
)
def test_ctrl_c_while_importing_ends_with_the_exit_code(body: str, tmp_path: Path) -> None:
    (tmp_path / "made.py").write_text(
        "import click, contextlib, signal, sys\n"
        "from slip_bags.cli import run_command\n"
        "@click.command()\n"
        f"def made():\n    {body}\n"
        "sys.exit(run_command(made, 'made'))\n"
    )
    done = subprocess.run([sys.executable, "-m", "made"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.strip()) == (2, "error: interrupted")


STAYS = """
import atexit, sys
from slip_vic import cli
atexit.register(print, "taken down")
cli.main = lambda: 7
cli.process()
"""


def test_a_run_ends_without_taking_down_the_interpreter() -> None:
    command = [sys.executable, "-c", STAYS, "run"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (7, "", "")


def test_a_process_started_inside_never_hears_ctrl_c() -> None:
    with held_back():
        process = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    process.send_signal(signal.SIGINT)
    process.communicate(b"line\n", timeout=60)
    assert process.returncode == 0


def test_ctrl_c_while_workers_start_is_one_line(tmp_path: Path) -> None:
    marker = f"slip_ctrl_c_{os.getpid()}_study"
    environment = child_environment(0) | {"SLIP_TEST_MARKER": marker, "NUMBA_DISABLE_JIT": "1"}  # minutes a case
    words = ["study", "--scenario", "paper_planar", "--sensor", "ideal", "--jobs", "2", "--out", str(tmp_path / "out")]
    process = subprocess.Popen(
        [sys.executable, "-m", "slip_vic.cli", *words],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    try:
        wait_until(lambda: len(marked(marker)) >= 3, "a worker", DEADLINE_S)  # this, its resource tracker, a worker
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=DEADLINE_S)
    finally:
        process.kill()
    assert process.returncode == 2, errors
    assert errors.strip() == "error: interrupted"
    assert marked(marker) == []


def test_a_full_disk_behind_stdout_is_one_line() -> None:
    words = [sys.executable, "-m", "slip_vic.cli", "bag", "--help"]
    with open("/dev/full", "w") as full:
        done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert done.stderr.strip() == (
        "error: the output: got No space left on device, expected room; the output is not complete"
    )


def marked(marker: str) -> list[int]:
    """Return the processes that carry the marker in their environment."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            if entry.name.isdigit() and marker.encode() in (entry / "environ").read_bytes():
                found.append(int(entry.name))
        except OSError:
            continue
    return found


HEAVY = ("numba", "mujoco", "pinocchio", "scipy", "matplotlib", "rclpy", "pandas")
ASK = """
import sys
from slip_vic.cli import main
sys.argv = ["slip-vic", *sys.argv[1:]]
code = main()
print("loaded:", *[name for name in {heavy} if name in sys.modules])
sys.exit(code)
"""


@pytest.mark.parametrize(
    ("words", "answer"),
    [
        (["run", "--scenario", "pane_two_arms_flat", "--set", "controller.gains.ks=1"], "unknown parameter"),
        (["check", "--mismatch", "mas"], "unknown mismatch 'mas'; did you mean mass-, mass+?"),
    ],
)
def test_a_mistyped_name_is_answered_before_anything_heavy_is_loaded(words: list[str], answer: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", ASK.format(heavy=HEAVY), *words], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert answer in done.stderr
    assert done.stdout.splitlines()[-1] == "loaded:"


def test_without_a_command_there_is_help_and_no_error() -> None:
    done = slip_vic()
    assert (done.returncode, done.stderr) == (0, "")
    assert "Commands:" in done.stdout


LITTLE = "import slip_core.files.resources as r; r.MAX_BYTES = 1 << 26; import slip_vic.cli as c; c.process()"
PARTS = "a/B[] a\n====\nMSG: a/B\na/C c\n====\nMSG: a/C\nuint8 c\n".replace("====", "=" * 80)
XACRO = '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">{}</robot>'
BOMBS: dict[str, tuple[list[str], Callable[[Path], object]]] = {
    "rows.csv": (["benchmark", "compare", "."], lambda path: os.truncate(path, 1 << 30)),
    "path.csv": (["retime", "path.csv"], lambda path: path.write_text("a,b," * (1 << 20))),
    "a.xacro": (["arm", "a.xacro"], lambda path: path.write_text(XACRO.format("<a/>" * (1 << 20)))),
    "listed.mcap": (["bag", "info", "listed.mcap"], lambda path: small_bag(path, "", b"", listed=3)),
    "nested.mcap": (["report", "nested.mcap"], lambda path: small_bag(path, PARTS, b"\0\0\x20\0" + bytes(1 << 21))),
}


@pytest.mark.parametrize("name", BOMBS)
def test_what_takes_much_memory_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / "rows.json").write_text('{"made_of": {}, "rows": ""}')
    (tmp_path / name).touch()
    words, make = BOMBS[name]
    make(tmp_path / name)
    assert (tmp_path / name).stat().st_size < 65_000 or "mcap" not in name
    command = [sys.executable, "-c", LITTLE, *words]
    done = subprocess.run(command, cwd=tmp_path, env=plain_environment(), capture_output=True, text=True, timeout=90.0)
    assert (done.returncode, done.stdout) == (2, "")
    assert re.match(r"error: .*(more than memory may hold: 64 MiB|exceeds limit)", done.stderr.splitlines()[-1])


def small_bag(path: Path, schema: str, data: bytes, listed: int = 1) -> None:
    """Write joint states of another kind, and an attachment that the index lists so many times."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1 << 26, index_types=IndexType.ATTACHMENT)
        writer.start()
        kind = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", schema.encode())
        channel = writer.register_channel("/joint_states", "cdr", kind)
        writer.add_attachment(0, 0, "a", "", bytes(9999))
        writer._Writer__attachment_indexes *= listed
        writer.add_message(channel, 0, b"\0\1\0\0" + data, 0)
        writer.finish()
