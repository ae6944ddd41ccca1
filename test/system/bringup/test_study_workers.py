"""The study's worker processes, killed for real: a death costs time and nothing else, and the command goes on."""

from __future__ import annotations

import importlib
import multiprocessing.util
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import psutil
import pytest
from click.testing import CliRunner

from slip_msgs_py.stop_flag import StopFlag
from slip_vic.cli import cli
from slip_vic.experiments import runner, suite
from slip_vic.experiments.engines import Died, PoolEngine
from slip_vic.experiments.rows import FILE
from slip_vic.experiments.runner import under_laws

SUPPORT = Path(__file__).parents[2] / "support"
LAWS = ("classical", "vic?slip_estimator=measured", "vic")
SIX = ["--scenario", "paper_planar", "--sensor", "ideal,event_1000", "--law", ",".join(LAWS), "--seeds", "1"]


@pytest.fixture
def tasks(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """A module that new processes can import too: there `test` is Python's own."""
    monkeypatch.syspath_prepend(SUPPORT)
    return importlib.import_module("engine_tasks")


@pytest.fixture
def pool() -> Iterator[PoolEngine]:
    with PoolEngine(2) as engine:
        yield engine


def workers_that_ran(folder: Path) -> set[int]:
    return {int(file.name.partition(".")[2]) for file in folder.iterdir()}


def test_every_task_once_and_tasks_share_the_workers(pool: PoolEngine, tasks: ModuleType, tmp_path: Path) -> None:
    results = dict(pool.run(tasks.note_and_square, str(tmp_path), range(20)))
    assert results == {number: number * number for number in range(20)}
    assert len(list(tmp_path.iterdir())) == 20
    assert len(workers_that_ran(tmp_path)) <= 2


def test_ctrl_c_while_a_worker_is_started_ends_the_run(
    pool: PoolEngine, tasks: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As soon as the worker exists, when `multiprocessing` still has to write to it."""
    start = multiprocessing.util.spawnv_passfds

    def interrupted(path: bytes, arguments: list[str], files: list[int]) -> int:
        worker = start(path, arguments, files)
        os.kill(os.getpid(), signal.SIGINT)
        return worker

    monkeypatch.setattr(multiprocessing.util, "spawnv_passfds", interrupted)
    with StopFlag(interrupts=True), pytest.raises(KeyboardInterrupt):
        list(pool.run(tasks.slow_square, str(tmp_path), range(12)))


def test_one_death_leaves_the_other_workers_alone_and_the_third_gives_a_task_up(
    pool: PoolEngine, tasks: ModuleType, tmp_path: Path
) -> None:
    results = dict(pool.run(tasks.deadly, str(tmp_path), range(12)))
    lost = results.pop(3)
    assert isinstance(lost, Died)
    assert re.search(r"3 times, at last process \d+ by SIGKILL", lost.reason)
    assert results == {number: number * number for number in range(12) if number != 3}
    assert len(list(tmp_path.glob("3.*"))) == 3
    assert len(list(tmp_path.glob("5.*"))) == 2
    assert sorted(task for task, _ in pool.deaths) == [3, 3, 3, 5]
    # Four deaths, four processes more than the two of the beginning: no other was thrown away.
    assert len(workers_that_ran(tmp_path)) <= 6


def test_what_a_task_raises_ends_the_run(pool: PoolEngine, tasks: ModuleType) -> None:
    with pytest.raises(ValueError, match=r"task \d of here"):
        list(pool.run(tasks.wrong, "here", range(3)))


@pytest.mark.parametrize("name", ["study", suite.SUITE])
def test_a_run_that_kills_its_workers_is_a_row(
    name: str, tasks: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a study and of the benchmark: the engine counts deaths by task, so worlds are hashable."""
    monkeypatch.setattr(runner, "run_on_worker", tasks.deadly_run)
    worlds = [replace(world, seed=k, set=name) for k, world in enumerate(suite.worlds("capped", 1, 4))]
    with PoolEngine(2) as workers:
        rows, _ = runner.fill(tmp_path / FILE, name, under_laws(worlds, ("vic",)), workers)
    found = {row["seed"]: row for row in rows}
    assert [found[str(seed)]["outcome"] for seed in range(4)] == ["ok", "crashed", "ok", "ok"]
    assert "its process died 3 times" in found["1"]["reason"]
    died = [line for line in capsys.readouterr().err.splitlines() if "a worker died" in line]
    assert len(died) == 3
    assert all(f"{name} 2 vic {worlds[1].scenario}" in line and "SIGKILL" in line for line in died)


CLIENT = """
import sys
from slip_vic.experiments.engines import PoolEngine
from engine_tasks import slow_square
if __name__ == "__main__":
    with PoolEngine(2) as engine:
        for number, _ in engine.run(slow_square, sys.argv[1], range(1000)):
            print(number, flush=True)
"""


def test_workers_end_with_a_client_that_is_killed(tmp_path: Path) -> None:
    (tmp_path / "client.py").write_text(CLIENT)
    notes = tmp_path / "notes"
    notes.mkdir()
    client = subprocess.Popen(
        [sys.executable, tmp_path / "client.py", notes],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([*sys.path, str(SUPPORT)])},
    )
    assert client.stdout is not None
    client.stdout.readline()
    workers = workers_that_ran(notes)
    client.send_signal(signal.SIGKILL)
    client.wait()
    while any(map(psutil.pid_exists, workers)):  # a worker that stays is seen by the limit of the test
        time.sleep(0.05)


def table_of(folder: Path) -> str:
    return (folder / FILE).read_text()


def test_a_study_whose_client_is_killed_goes_on(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "slip_vic.cli", "study"]
    asked = [*SIX, "--set", "bridge.duration_s=0.3"]
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    client = subprocess.Popen([*command, *asked, "--jobs", "1", "--out", killed], stderr=subprocess.DEVNULL)
    while not (killed / FILE).exists() or len(table_of(killed).splitlines()) < 3:
        assert client.poll() is None, "it ended before it could be killed"
        time.sleep(0.01)
    os.kill(client.pid, signal.SIGKILL)
    client.wait()
    there = len(table_of(killed).splitlines()) - 1
    again = CliRunner().invoke(cli, ["study", *asked, "--jobs", "2", "--out", str(killed)], catch_exceptions=False)
    assert again.exit_code == 0, again.output
    assert f"{there} of 6 runs were there already" in again.output
    CliRunner().invoke(cli, ["study", *asked, "--jobs", "2", "--out", str(whole)], catch_exceptions=False)
    assert table_of(killed) == table_of(whole)
