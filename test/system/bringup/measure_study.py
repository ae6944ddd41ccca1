"""Numbers for docs/studies.md: what an engine costs for each task, and a study on Ray of which parts are killed.

python test/system/bringup/measure_study.py overhead
python test/system/bringup/measure_study.py kills      # needs Ray
python test/system/bringup/measure_study.py beside     # the Ray node dies on which the command runs
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import importlib.util
import os
import pickle
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

SUPPORT = Path(__file__).parents[2] / "support"
sys.path.insert(0, str(SUPPORT))
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))

from slip_vic.study.cases import Case  # noqa: E402
from slip_vic.study.contents import gather  # noqa: E402
from slip_vic.study.engines import EngineName, open_engine  # noqa: E402
from slip_vic.study.runner import run_on_worker  # noqa: E402
from slip_vic.study.table import Settings, StudyTable  # noqa: E402

tasks, rays = importlib.import_module("study_tasks"), importlib.import_module("ray_cluster")
JOBS = 2
TASKS, ROUNDS = 200, 5
KILLED_AFTER, LONGEST_S = 4, 120.0


def overhead(folder: Path) -> None:
    """Print what a task that does nothing costs, next to a case; in turns, as the machine may have other work."""
    names: list[EngineName] = ["pool", *(["ray"] if importlib.util.find_spec("ray") else [])]
    case = Case("paper_planar", "vic", "vision_25", "observer", "none", 0)
    contents = gather([case.scenario], [case.sensor], ())
    run_on_worker(contents, case)
    spent = dict.fromkeys(("case", "row", *names), 0.0)
    settings = Settings.of(contents, [])
    with contextlib.ExitStack() as stack:
        engines = {}
        for name in names:
            start = time.perf_counter()
            engines[name] = stack.enter_context(open_engine(name, JOBS))
            list(engines[name].run(tasks.note_and_square, str(folder), range(2 * JOBS)))
            print(f"{name}: {time.perf_counter() - start:.1f} s to start")
        table = stack.enter_context(StudyTable(folder / "table", settings))
        for _ in range(ROUNDS):
            start = time.perf_counter()
            result = run_on_worker(contents, case)
            spent["case"] += time.perf_counter() - start
            start = time.perf_counter()
            for _ in range(TASKS):
                table.append(result)
            spent["row"] += (time.perf_counter() - start) / TASKS
            for name, engine in engines.items():
                start = time.perf_counter()
                list(engine.run(tasks.note_and_square, str(folder), range(TASKS)))
                spent[name] += (time.perf_counter() - start) / TASKS
    for name, seconds in spent.items():
        print(f"{name}: {1e3 * seconds / ROUNDS:.2f} ms, {100.0 * seconds / spent['case']:.2f} % of a case")
    print(f"contents of a study, pickled: {len(pickle.dumps(contents)) / 1e3:.0f} kB")


def rows_of(folder: Path) -> int:
    """Return how many rows a study has."""
    table = folder / "study.csv"
    return max(0, len(table.read_text().splitlines()) - 1) if table.exists() else 0


def kills(folder: Path) -> None:
    """Kill workers, a node and the client of a study on a head and three nodes; compare with a study on the pool."""
    study = [sys.executable, "-m", "slip_vic.cli", "study"]
    asked = ["--sensor", "ideal,vision_25,event_1000", "--law", "vic,classical", "--seeds", "6"]
    short = ["--set", "bridge.duration_s=0.5"]
    on_ray = [*study, "--engine", "ray", "--out", str(folder / "ray")]
    killed: list[str] = []
    rng = random.Random(0)
    start = time.perf_counter()
    with rays.ray_cluster(3) as cluster:
        client = subprocess.Popen([*on_ray, *asked, *short])
        plan = {3: "worker", 7: "worker", 11: "worker", 14: "node", 17: "new node", 20: "worker", 24: "client"}
        for rows, what in plan.items():
            while rows_of(folder / "ray") < rows:
                if client.poll() is not None:
                    raise SystemExit("the study ended before everything was killed")
                time.sleep(0.02)
            if what == "worker":
                while not (busy := rays.busy_workers("run_on_worker")):
                    time.sleep(0.02)
                rng.choice(busy).kill()
            elif what == "node":
                rays.kill_node(cluster)
            elif what == "new node":
                cluster.add_node(num_cpus=1)
            else:
                client.kill()
                client.wait()
            killed.append(f"{what} after {rows} rows")
        print("killed or joined:", ", ".join(killed), f"; {rows_of(folder / 'ray')} rows on the disk")
        subprocess.run([*on_ray, "--resume"], check=True)
    print(f"with all kills {time.perf_counter() - start:.0f} s")
    left = [p for p in psutil.process_iter(["cmdline"]) if (p.info["cmdline"] or [""])[0].startswith("ray::")]
    print(f"processes of Ray that are left: {len(left)}")
    start = time.perf_counter()
    subprocess.run([*study, *asked, *short, "--jobs", "3", "--out", folder / "pool"], check=True)
    print(f"on the pool without kills {time.perf_counter() - start:.0f} s")
    same = (folder / "ray/study.csv").read_bytes() == (folder / "pool/study.csv").read_bytes()
    print(f"{rows_of(folder / 'pool')} rows, files equal: {same}")


def beside(folder: Path) -> None:
    """Kill the Ray node that the command is attached to, go on on another cluster, compare with the pool."""
    study = [sys.executable, "-m", "slip_vic.cli", "study"]
    asked = ["--sensor", "ideal,vision_25", "--law", "vic", "--scenario", "paper_planar", "--seeds", "6"]
    short = ["--set", "bridge.duration_s=0.5"]
    on_ray = [*study, "--engine", "ray", "--out", str(folder / "ray")]
    with rays.ray_cluster(2) as cluster:
        client = subprocess.Popen([*on_ray, *asked, *short])
        while rows_of(folder / "ray") < KILLED_AFTER:
            time.sleep(0.02)
        start = time.perf_counter()
        psutil.Process(cluster.list_all_nodes()[0].all_processes["raylet"][0].process.pid).kill()
        try:
            code = f"ended with exit code {client.wait(LONGEST_S)}"
        except subprocess.TimeoutExpired:
            client.kill()
            code = "did not end"
        print(
            f"the command {code} after {time.perf_counter() - start:.0f} s; {rows_of(folder / 'ray')} rows on the disk"
        )
    with rays.ray_cluster(2):
        subprocess.run([*on_ray, "--resume"], check=True)
    subprocess.run([*study, *asked, *short, "--jobs", "2", "--out", folder / "pool"], check=True)
    same = (folder / "ray/study.csv").read_bytes() == (folder / "pool/study.csv").read_bytes()
    print(f"{rows_of(folder / 'pool')} rows, files equal: {same}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["overhead", "kills", "beside"])
    with tempfile.TemporaryDirectory() as scratch:
        {"overhead": overhead, "kills": kills, "beside": beside}[parser.parse_args().what](Path(scratch))
