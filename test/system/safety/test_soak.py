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
from test.campaigns.soak.growth import Limits, Sample, growth_of, robust_slope
from test.campaigns.soak.run import sample_process

LEAK = """
import os, sys, time
kept = []
while True:
    kept.append(bytearray(os.urandom(4096) * 64))
    kept.append(open(os.devnull))
    time.sleep(0.01)
"""


def test_slope_of_a_line_with_jumps() -> None:
    times = [float(t) for t in range(100)]
    steps = [2.0 * t + (500.0 if t > 80 else 0.0) for t in times]
    assert robust_slope(times, steps) == pytest.approx(2.0, rel=0.05)
    assert robust_slope(times, [3.0] * 100) == 0.0
    assert robust_slope([1.0], [3.0]) == 0.0


def test_warm_up_does_not_count() -> None:
    samples = [Sample(float(t), (50 + min(t, 10) * 10) << 20, 20, 8) for t in range(100)]
    growth = growth_of(samples)
    assert growth.memory_mib.per_hour == 0.0
    assert growth.grows(Limits()) == []


def test_a_process_that_leaks_is_seen() -> None:
    with subprocess.Popen([sys.executable, "-c", LEAK]) as process:
        watched, start = psutil.Process(process.pid), time.monotonic()
        samples = []
        while len(samples) < 30:
            samples.append(sample_process(watched, time.monotonic() - start))
            time.sleep(0.05)
        process.kill()
    growth = growth_of(samples)
    assert growth.memory_mib.rise > 1.0
    words = growth.grows(Limits())
    assert [word.split(" by ")[0] for word in words] == ["memory", "open files"]


def test_a_short_soak_runs_and_reports(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    result = CliRunner().invoke(soak, ["--minutes", "0.1", "--rate", "250", "--out", str(tmp_path)])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.output
    content = json.loads((tmp_path / "soak.json").read_text())
    assert set(content["growth"]) == {"bridge", "controller", "recorder", "soak"}
    assert content["said"]["bridge"]["ticks"] > 300
    assert 0.0 <= content["law_share"] <= 1.0  # how much of it is a matter of the machine's timing
    for name, series in content["series"].items():
        assert len(series) >= 5, name
        assert all(rss > 1 << 20 and files > 3 for _, rss, files, _ in series)
    assert "grows" in result.output
