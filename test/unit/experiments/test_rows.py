"""Files of rows: they continue, keep every bit, merge, and refuse what was made of something else."""

from __future__ import annotations

import io
import os
import pickle
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from slip_core.errors import InputError
from slip_description import urdf_text
from slip_vic.cli import main
from slip_vic.experiments.contents import MixedVersions, check_versions, gather
from slip_vic.experiments.rows import Asked, Plan, RowFile, Task, digest_of, key_of, merged
from slip_vic.experiments.run import METRICS, TIMED, Result, failed
from slip_vic.experiments.world import World
from slip_vic.presets import preset_text
from slip_vic.run.progress import progress
from slip_vic.run.versions import versions
from slip_vic.scenarios import scenario_text

PLAN = Plan({"numpy": "2.0"}, ())
WORLDS = tuple(
    World("paper_planar", sensor, seed, number=seed) for sensor in ("ideal", "vision_25") for seed in range(5)
)
ASKED = Asked(WORLDS, ("classical", "vic"))


def result(seed: int = 0, value: float = 1.0, law: str = "vic") -> Result:
    return Result(World("paper_planar", "ideal", seed, number=seed), law, "ok", "", dict.fromkeys(METRICS, value))


def test_a_file_continues_where_it_stopped(tmp_path: Path) -> None:
    path = tmp_path / "study.csv"
    with RowFile(path, PLAN) as file:
        file.append(result(1))
        file.append(failed(result(2).world, "vic", "crashed", "it was\nthe weather"))
    with path.open("a", encoding="utf-8") as cut:
        cut.write("study,3,vic,paper_pl")  # cut off by a full disk or a kill
    with RowFile(path, PLAN) as again:
        assert again.done() == {Task(*result(1)[:2]).key}
        again.append(result(0))
        assert [row["seed"] for row in again.rows()] == ["1", "0"]
        again.sort()
        again.append(result(10))
        again.append(result(2))
        again.sort()
        assert [row["seed"] for row in again.rows()] == ["0", "1", "2", "10"]


def test_a_row_keeps_every_bit(tmp_path: Path) -> None:
    with RowFile(tmp_path / "study.csv", PLAN) as file:
        file.append(result(0, 0.1 + 0.2))
        (row,) = file.rows()
    assert {float(row[name]) for name in METRICS} == {0.1 + 0.2}
    assert key_of(row) == Task(*result(0)[:2]).key


def test_a_file_keeps_to_what_it_is_made_of(tmp_path: Path) -> None:
    path = tmp_path / "study.csv"
    with RowFile(path, PLAN):
        pass
    with pytest.raises(InputError, match=r"rows made with numpy 2\.0, expected numpy 2\.1"):
        RowFile(path, Plan({"numpy": "2.1"}, ()))
    with RowFile(path, Plan({"sensor ideal": "d3"}, ())) as file:
        assert file.plan.made_of == {"numpy": "2.0", "sensor ideal": "d3"}
    path.with_suffix(".json").write_text('{"assignments": []}')  # as versions before wrote it
    with pytest.raises(InputError, match="another place"):
        RowFile(path, PLAN)


def test_a_place_that_cannot_be_written_is_one_line() -> None:
    with pytest.raises(InputError, match="--out /proc/study"):
        RowFile(Path("/proc/study/study.csv"), PLAN)


def test_a_file_is_for_one_process_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "study.csv"
    with RowFile(path, PLAN), pytest.raises(InputError, match=f"in use by process {os.getpid()}"):
        RowFile(path, PLAN)
    with RowFile(path, PLAN):
        pass


def test_what_was_asked_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "study.csv"
    with RowFile(path, replace(PLAN, asked=(ASKED,))):
        pass
    assert Plan.read(path.with_suffix(".json")) == replace(PLAN, asked=(ASKED,))
    more = Asked(WORLDS[:1], ("governed",))
    with RowFile(path, replace(PLAN, asked=(ASKED, more))) as file:
        assert file.plan.asked == (ASKED, more)
        assert len(file.plan.tasks()) == 21


def filled(path: Path, worlds: tuple[World, ...]) -> RowFile:
    with RowFile(path, replace(PLAN, asked=(Asked(worlds, ASKED.laws),))) as file:
        for world in reversed(worlds):
            for law in ASKED.laws:
                file.append(Result(world, law, "ok", "", dict.fromkeys(METRICS, world.seed / 7.0)))
        file.sort()
    return file


def test_shards_merge_to_the_whole(tmp_path: Path) -> None:
    parts = [filled(tmp_path / f"{k}.csv", WORLDS[k::3]).path for k in range(3)]
    whole = filled(tmp_path / "whole.csv", WORLDS)
    with merged(parts, tmp_path / "merged.csv") as file:
        assert file.path.read_text() == whole.path.read_text()
        assert len(file.rows()) == len(file.plan.tasks()) == 20


def test_merge_refuses_what_does_not_fit(tmp_path: Path) -> None:
    for name, version, value in (("a", "2.0", 1.0), ("b", "2.1", 1.0), ("c", "2.0", 2.0)):
        with RowFile(tmp_path / f"{name}.csv", Plan({"numpy": version}, ())) as file:
            file.append(result(0, value))
    with pytest.raises(InputError, match=r"b\.csv: got rows made with numpy 2\.1, expected numpy 2\.0"):
        merged([tmp_path / "a.csv", tmp_path / "b.csv"], tmp_path / "out.csv")
    with pytest.raises(InputError, match="another result of study 0 vic paper_planar"):
        merged([tmp_path / "a.csv", tmp_path / "c.csv"], tmp_path / "out.csv")
    with pytest.raises(InputError, match=r"nothing\.json"):
        merged([tmp_path / "nothing.csv"], tmp_path / "out.csv")


def test_the_digest_of_rows_leaves_times_out(tmp_path: Path) -> None:
    with RowFile(tmp_path / "study.csv", PLAN) as file:
        file.append(result())
        (row,) = file.rows()
    assert digest_of([row]) == digest_of([row | dict.fromkeys(TIMED, "0.5")])
    assert digest_of([row]) != digest_of([row | {"slip_linear_m": "0.5"}])


def test_a_world_runs_from_texts_alone(tmp_path: Path) -> None:
    """Files of one's own, gone before the world is loaded."""
    files = tmp_path / "task.yaml", tmp_path / "mine.yaml", tmp_path / "arm.urdf"
    for file, text in zip(
        files, (scenario_text("paper_planar"), preset_text("sensors", "event_1000"), urdf_text()), strict=True
    ):
        file.write_text(text)
    arm = (f"bridge.robot_description_file={files[2]}",)
    own = World(str(files[0]), str(files[1]), 3, arm)
    contents = gather([own.scenario], [own.sensor], arm)
    before = own.load("vic", "observer")
    for file in files:
        file.unlink()
    assert own.load("vic", "observer", (), contents.texts) == before
    assert {f"scenario {files[0]}", f"sensor {files[1]}", f"arm {files[2]}"} < set(contents.made_of)


def test_a_worker_with_other_versions_is_named() -> None:
    check_versions(versions())
    with pytest.raises(MixedVersions, match=r"mujoco .* expected 0\.1"):
        check_versions({**versions(), "mujoco": "0.1"})
    error = pickle.loads(pickle.dumps(MixedVersions("worker on a: got b")))  # as it comes back from a worker
    assert str(error) == "worker on a: got b"


def test_progress_without_a_terminal_is_lines() -> None:
    now = [0.0]
    written = io.StringIO()
    with progress("study", 100, 40, Console(file=written, get_time=lambda: now[0])) as report:
        for done in range(41, 101):
            now[0] += 0.5
            report(done, "1 workers died" if done > 90 else "")
    assert written.getvalue().splitlines() == [
        "study: 60 of 100 done, 2 per second, about 20 s left",
        "study: 80 of 100 done, 2 per second, about 10 s left",
        "study: 100 of 100 done, 1 workers died",
    ]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["study", "--resume", "--out", "nothing"], "nothing/study.json"),
        (["study", "--shard", "4/3"], "4/3 is not i/n"),
        (["study", "--estimator", "guess"], "unknown estimator 'guess'"),
        (["study", "--sensor", "vision_26"], "vision_25"),
        (["merge", "nowhere", "--out", "all"], "nowhere"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["slip-vic", *words])
    assert main() == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
