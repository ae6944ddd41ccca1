"""What rows are made of, by name; workers that run something else; progress."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from rich.console import Console

from slip_core.errors import InputError
from slip_vic.experiments.runner import _scenario, made_of, run_on_worker
from slip_vic.experiments.world import World
from slip_vic.presets import preset_text
from slip_vic.run.progress import progress
from slip_vic.run.versions import versions


def test_rows_are_made_of_files_and_laws(tmp_path: Path) -> None:
    own = tmp_path / "task.yaml"
    digests = []
    for text in (
        preset_text("scenarios", "paper_planar"),
        preset_text("scenarios", "paper_planar") + "\n# another line\n",
    ):
        own.write_text(text)
        _scenario.cache_clear()
        found = made_of([World(str(own), "ideal", law="fixed_grip?factor=2"), World("paper_planar", law="vic")])
        assert set(found) - set(versions()) == {
            f"scenario {own}", "scenario paper_planar", "sensor ideal", "law fixed_grip?factor=2"
        }  # fmt: skip
        digests.append(found[f"scenario {own}"])
    assert digests[0] != digests[1]


def test_a_worker_with_other_versions_is_named() -> None:
    world = World("paper_planar", settings=("bridge.duration_s=0.01",), law="classical")
    assert run_on_worker(versions(), world)["outcome"] == "ok"
    with pytest.raises(InputError, match=r"worker on .*: got mujoco .*, expected 0\.1"):
        run_on_worker({**versions(), "mujoco": "0.1"}, world)


def test_progress_without_a_terminal_is_lines() -> None:
    now = [0.0]
    written = io.StringIO()
    with progress(Console(file=written, get_time=lambda: now[0])) as add_bar:
        report = add_bar("study", 100, 40)
        for done in range(41, 101):
            now[0] += 0.5
            report(done, "1 workers died" if done > 90 else "")
    assert written.getvalue().splitlines() == [
        "study: 60 of 100 done, 20 s left",
        "study: 80 of 100 done, 10 s left",
        "study: 100 of 100 done, 1 workers died",
    ]
