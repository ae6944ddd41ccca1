"""Studies on Ray, with workers, a node and the client killed for real: a head and nodes as processes on this machine.

Ray is the optional extra slip-vic[cluster]; without it these tests are skipped.
"""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from slip_core.errors import InputError
from slip_vic.experiments import suite
from slip_vic.experiments.engines import Died, EngineName, RayEngine, open_engine
from slip_vic.experiments.rows import FILE, digest_of
from slip_vic.experiments.runner import fill, under_laws
from test.support.ray_cluster import busy_workers, ray_cluster

SUPPORT = Path(__file__).parents[2] / "support"
WITHOUT_RAY = importlib.util.find_spec("ray") is None
needs_ray = pytest.mark.skipif(WITHOUT_RAY, reason="Ray is not installed here: it is the extra slip-vic[cluster]")


@pytest.fixture(scope="module")
def tasks() -> Iterator[ModuleType]:
    """A module that new processes can import too, the nodes' included."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(SUPPORT)
        patch.setenv("PYTHONPATH", os.pathsep.join(filter(None, sys.path)))
        yield importlib.import_module("engine_tasks")


@pytest.fixture(scope="module")
def nodes(tasks: ModuleType) -> Iterator[Any]:
    with ray_cluster(3) as cluster:
        yield cluster


@pytest.fixture
def cluster(nodes: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setenv("RAY_ADDRESS", nodes.address)
    return nodes


@pytest.mark.skipif(not WITHOUT_RAY, reason="Ray is installed here")
def test_without_ray_one_line_says_so() -> None:
    with pytest.raises(InputError, match=r"needs ray: pip install 'slip-vic\[cluster\]'"):
        RayEngine(1)


@needs_ray
def test_an_address_where_nobody_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RAY_ADDRESS", "127.0.0.1:1")
    with pytest.raises(InputError, match="RAY_ADDRESS"):
        RayEngine(1)


@needs_ray
def test_a_task_that_kills_its_workers_is_given_up(cluster: Any, tasks: ModuleType, tmp_path: Path) -> None:
    with RayEngine(1) as engine:
        results = dict(engine.run(tasks.deadly, str(tmp_path), range(8)))
        with pytest.raises(ValueError, match=r"task \d of here"):
            list(engine.run(tasks.wrong, "here", range(3)))
    lost = results.pop(3)
    assert isinstance(lost, Died)
    assert results == {number: number * number for number in range(8) if number != 3}
    assert len(list(tmp_path.glob("3.*"))) == 3


CLIENT = """
import sys
from slip_vic.experiments.engines import RayEngine
from engine_tasks import slow_square
with RayEngine(1) as engine:
    for number, _ in engine.run(slow_square, sys.argv[1], range(100000)):
        print(number, flush=True)
"""


@needs_ray
def test_a_client_that_is_killed_leaves_the_cluster_free(cluster: Any, tasks: ModuleType, tmp_path: Path) -> None:
    client = subprocess.Popen([sys.executable, "-c", CLIENT, tmp_path], stdout=subprocess.PIPE, text=True)
    assert client.stdout is not None
    client.stdout.readline()
    client.kill()
    client.wait()
    while busy_workers("slow_square"):  # one that goes on is seen by the limit of the test
        time.sleep(0.1)
    with RayEngine(1) as engine:
        assert dict(engine.run(tasks.note_and_square, str(tmp_path), range(3))) == {0: 0, 1: 1, 2: 4}


@needs_ray
def test_rows_of_the_benchmark_are_those_of_the_pool(cluster: Any, tmp_path: Path) -> None:
    """All numbers but the time of a step: three worlds with noisy drives and sensors."""
    drawn = [world for world in suite.worlds("capped", 1, 6) if world.drive == "drawn"]
    short = [replace(world, settings=(*world.settings, "bridge.duration_s=0.1")) for world in drawn]
    assert len(short) == 3
    found = []
    engines: tuple[EngineName, ...] = ("pool", "ray")
    for one in engines:
        with open_engine(one, 1) as workers:
            found.append(fill(tmp_path / one / FILE, one, under_laws(short, ("vic",)), workers)[0])
    pool, ray = found
    assert len(ray) == 3
    assert all(float(row["effort_rate_rms_n_m_s"]) > 0.0 for row in ray)
    assert digest_of(ray) == digest_of(pool)
