"""What a process requests of the system: granted, refused with a line, and set before the module is imported."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

PROBE = """
import json, os, sys
print(json.dumps({"argv": sys.argv[1:], "cores": sorted(os.sched_getaffinity(0)), "policy": os.sched_getscheduler(0),
                  "threads": __name__}))
"""
LAST_CORE = max(os.sched_getaffinity(0))
NO_SUCH_CORE = 4095


def run(folder: Path, *words: str, events: bool = False) -> subprocess.CompletedProcess[str]:
    (folder / "probe_module.py").write_text(PROBE)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])}
    environment.pop("SLIP_VIC_EVENTS", None)
    if events:
        environment["SLIP_VIC_EVENTS"] = "1"
    command = [sys.executable, "-m", "slip_msgs_py.realtime", *words]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=90.0, check=False)


def test_module_runs_on_its_core(tmp_path: Path) -> None:
    done = run(tmp_path, "--cpu", str(LAST_CORE), "probe_module", "--ros-args", "-r", "__ns:=/a")
    seen = json.loads(done.stdout)
    assert seen["cores"] == [LAST_CORE]
    assert seen["argv"] == ["--ros-args", "-r", "__ns:=/a"]
    assert seen["threads"] == "__main__"
    assert done.returncode == 0


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("--cpu", str(NO_SUCH_CORE)), f"core {NO_SUCH_CORE} is not available"),
        (("--fifo", "1000"), "SCHED_FIFO 1000 is not permitted"),
    ],
)
def test_unavailable_options_warn(tmp_path: Path, words: tuple[str, ...], line: str) -> None:
    done = run(tmp_path, *words, "probe_module")
    assert done.returncode == 0
    assert done.stderr.startswith(f"warning: probe_module: {line}")
    assert done.stderr.count("\n") == 1
    as_event = run(tmp_path, *words, "probe_module", events=True)
    first, probe = (json.loads(text) for text in as_event.stdout.splitlines())
    assert first["event"] == "warning"
    assert first["text"].startswith(line)
    assert probe["policy"] == os.SCHED_OTHER
