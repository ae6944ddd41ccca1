"""The soak sees what grows, in processes that really do."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from click.testing import CliRunner

from test.campaigns.soak.cli import soak
from test.campaigns.soak.growth import grows, growth_of, sample_process

LEAK = """
import os, sys, time
kept = []
while True:
    kept.append(bytearray(os.urandom(4096) * 64))
    kept.append(open(os.devnull))
    time.sleep(0.01)
"""


def test_leaking_process_grows() -> None:
    with subprocess.Popen([sys.executable, "-c", LEAK]) as process:
        watched, start = psutil.Process(process.pid), time.monotonic()
        samples = []
        while len(samples) < 30:
            samples.append(sample_process(watched, time.monotonic() - start))
            time.sleep(0.05)
        process.kill()
    growth = growth_of(samples)
    assert growth["memory [MiB]"].rise > 1.0
    assert [word.split(" by ")[0] for word in grows(growth)] == ["memory [MiB]", "open files"]


def test_a_short_soak_runs_and_reports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    result = CliRunner().invoke(soak, ["--minutes", "0.1", "--rate", "250", "--out", str(tmp_path)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.output
    content = json.loads((tmp_path / "soak.json").read_text())
    assert set(content["growth"]) == {"bridge", "controller", "recorder", "soak"}
    assert content["ticks"] > 300
    for name, samples in content["series"].items():
        assert len(samples) >= 5, name
        assert all(mib > 1.0 and files > 3 for _, mib, files, _ in samples)
