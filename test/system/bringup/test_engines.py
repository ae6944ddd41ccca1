"""The engines of experiments, with workers and clients killed for real: a death costs time and nothing else.

Ray is the optional extra slip-vic[cluster], here a head and nodes as processes on this machine; without it those tests
are skipped.
"""

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

from slip_core.errors import InputError
from slip_msgs_py.stop_flag import StopFlag
from slip_vic.experiments import runner, suite
from slip_vic.experiments.engines import ENGINES, Died, Engine, PoolEngine, RayEngine
from slip_vic.experiments.rows import FILE, digest_of
from slip_vic.experiments.runner import fill, under_laws

SUPPORT = Path(__file__).parents[2] / "support"
WITHOUT_RAY = importlib.util.find_spec("ray") is None
needs_ray = pytest.mark.skipif(WITHOUT_RAY, reason="Ray is not installed here: it is the extra slip-vic[cluster]")
BOTH = pytest.mark.parametrize("name", ["pool", pytest.param("ray", marks=needs_ray)])


@pytest.fixture(scope="module")
def tasks() -> Iterator[ModuleType]:
    """A module that new processes can import too, the nodes' included: there `test` is Python's own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(SUPPORT)
        patch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
        yield importlib.import_module("engine_tasks")


@pytest.fixture(scope="module")
def cluster(tasks: ModuleType) -> Iterator[str]:
    """Set RAY_ADDRESS to that of a head without cores and three nodes, where Ray is."""
    if WITHOUT_RAY:
        yield ""
        return
    from ray.cluster_utils import Cluster

    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    try:
        for _ in range(3):
            nodes.add_node(num_cpus=1)
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv("RAY_ADDRESS", nodes.address)
            yield nodes.address
    finally:
        nodes.shutdown()


@pytest.fixture
def engine(name: str, cluster: str) -> Iterator[Engine]:
    with ENGINES[name](2) as opened:
        yield opened


@pytest.fixture
def pool(tasks: ModuleType) -> Iterator[PoolEngine]:
    with PoolEngine(2) as opened:
        yield opened


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


@BOTH
def test_the_third_death_gives_a_task_up(engine: Engine, tasks: ModuleType, tmp_path: Path) -> None:
    results = dict(engine.run(tasks.deadly, str(tmp_path), range(12)))
    lost = results.pop(3)
    assert isinstance(lost, Died)
    assert results == {number: number * number for number in range(12) if number != 3}
    assert len(list(tmp_path.glob("3.*"))) == 3
    assert len(list(tmp_path.glob("5.*"))) == 2
    if isinstance(engine, PoolEngine):
        assert re.search(r"3 times, at last process \d+ by SIGKILL", lost.reason)
        assert sorted(task for task, _ in engine.deaths) == [3, 3, 3, 5]
        # Four deaths, four processes more than the two of the beginning: no other was thrown away.
        assert len(workers_that_ran(tmp_path)) <= 6


@BOTH
def test_what_a_task_raises_ends_the_run(engine: Engine, tasks: ModuleType) -> None:
    with pytest.raises(ValueError, match=r"task \d of here"):
        list(engine.run(tasks.wrong, "here", range(3)))


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
from slip_vic.experiments.engines import ENGINES
from engine_tasks import slow_square
if __name__ == "__main__":
    with ENGINES[sys.argv[1]](2) as engine:
        for number, _ in engine.run(slow_square, sys.argv[2], range(100000)):
            print(number, flush=True)
"""


@BOTH
def test_workers_end_with_a_client_that_is_killed(name: str, cluster: str, tmp_path: Path) -> None:
    (tmp_path / "client.py").write_text(CLIENT)
    notes = tmp_path / "notes"
    notes.mkdir()
    command = [sys.executable, tmp_path / "client.py", name, notes]
    client = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert client.stdout is not None
    client.stdout.readline()
    workers = workers_that_ran(notes)
    client.kill()
    client.wait()
    # A worker that stays is seen by the limit of the test. Ray writes the task of a worker into its title.
    while any(
        one.pid in workers if name != "ray" else (one.info["cmdline"] or [""])[0] == "ray::slow_square"
        for one in psutil.process_iter(["cmdline"])
    ):
        time.sleep(0.05)


@pytest.mark.skipif(not WITHOUT_RAY, reason="Ray is installed here")
def test_without_ray_one_line_says_so() -> None:
    with pytest.raises(InputError, match=r"needs ray: pip install 'slip-vic\[cluster\]'"):
        RayEngine(1)


@needs_ray
def test_an_address_without_a_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_ADDRESS", "127.0.0.1:1")
    with pytest.raises(InputError, match="RAY_ADDRESS"):
        RayEngine(1)


@needs_ray
def test_rows_of_the_benchmark_are_those_of_the_pool(cluster: str, tmp_path: Path) -> None:
    """All numbers but the time of a step: three worlds with noisy drives and sensors."""
    drawn = [world for world in suite.worlds("capped", 1, 6) if world.drive == "drawn"]
    short = [replace(world, settings=(*world.settings, "bridge.duration_s=0.1")) for world in drawn]
    found = []
    for one in ("pool", "ray"):
        with ENGINES[one](1) as workers:
            found.append(fill(tmp_path / one / FILE, one, under_laws(short, ("vic",)), workers)[0])
    assert len(found[1]) == len(short) == 3
    assert all(float(row["effort_rate_rms_n_m_s"]) > 0.0 for row in found[1])
    assert digest_of(found[1]) == digest_of(found[0])
