"""The study: cases, mismatches, a table that survives interruptions, workers that die, and the verdict on gains."""

from __future__ import annotations

import io
import os
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

from slip_core.errors import InputError
from slip_description import urdf_text
from slip_vic.cli import cli, main
from slip_vic.presets import preset_text
from slip_vic.run.progress import progress
from slip_vic.run.versions import versions
from slip_vic.scenarios import scenario_text
from slip_vic.scenarios.scenario import load_scenario
from slip_vic.study.cases import MISMATCHES, Asked, Case, all_cases
from slip_vic.study.contents import MixedVersions, check_versions, gather
from slip_vic.study.run_case import run_case
from slip_vic.study.summary import spread, summary_tables, write_picture
from slip_vic.study.table import METRICS, STUDY, CaseResult, Settings, StudyTable, merge

ISSUE_COLUMNS = (
    "scenario,law,sensor,estimator,mismatch,seed,outcome,slip_linear_m,slip_angular_rad,slip_speed_peak_m_s,"
    "tracking_rms_m,final_error_m,final_error_rad,attitude_excursion_rad"
)
SHORT = ("bridge.duration_s=0.05",)


def case(seed: int = 0, estimator: str = "observer", mismatch: str = "none", sensor: str = "event_1000") -> Case:
    return Case("paper_planar", "vic", sensor, estimator, mismatch, seed)


def result(of: Case, value: float = 1.0) -> CaseResult:
    return CaseResult(of, "ok", "", dict.fromkeys(METRICS, value))


def test_columns_are_the_promised_ones() -> None:
    assert ",".join(STUDY.columns).startswith(ISSUE_COLUMNS)


def test_every_combination_once() -> None:
    laws, sensors = ["classical", "vic"], ["ideal", "vision_25"]
    cases = all_cases(["paper_planar"], laws, sensors, ["measured", "observer"], ["none", "mass+"], range(3))
    assert len(cases) == len(set(cases)) == 36  # classical impedance control has no estimator
    with pytest.raises(InputError, match=r"mass\+"):
        all_cases(["paper_planar"], ["vic"], ["ideal"], ["observer"], ["mass"], range(1))


@pytest.mark.parametrize("mismatch", MISMATCHES)
def test_a_mismatch_changes_the_world_and_not_what_the_controller_knows(mismatch: str) -> None:
    plain, wrong = case().load(), case(mismatch=mismatch).load()
    assert wrong.controller == plain.controller
    assert (wrong.bridge == plain.bridge) == (mismatch == "none")


def test_sensor_reaches_both_nodes() -> None:
    scenario = case(sensor="optical_flow_120").load()
    assert scenario.bridge.sensors.slip.rate_hz == scenario.controller.slip_sensor.rate_hz == 120.0
    assert scenario.controller.slip_estimator == "observer"
    assert case(sensor="optical_flow_120", estimator="measured").load().controller.slip_estimator == "measured"


def test_a_case_runs_and_one_that_cannot_is_a_row() -> None:
    good = run_case(case(), SHORT)
    assert good.outcome == "ok"
    assert all(np.isfinite(value) for name, value in good.metrics.items() if name != "arrival_s")
    assert np.isnan(good.metrics["arrival_s"])  # the path is not over
    refused = run_case(case(estimator="measured"), (*SHORT, "controller.gains.k_s_mode=fixed"))
    assert refused.outcome == "refused"
    assert "k_s" in refused.reason
    assert run_case(case(), ("bridge.duration_s=nonsense",)).outcome == "refused"


def test_a_simulation_that_diverges_is_no_refusal() -> None:
    """Gravity that no arm bears: the state stops being physical in the first tick."""
    result = run_case(case(), (*SHORT, "bridge.gravity=[0.0, 0.0, -1e6]", "bridge.grip.pad_size=[1e3, 1e3]"))
    assert result.outcome == "lost"
    assert "simulation diverged" in result.reason


SETTINGS = Settings((), {"sensor event_1000": "d1"}, {"numpy": "2.0"})


def test_a_table_goes_on_where_it_stopped(tmp_path: Path) -> None:
    with StudyTable(tmp_path, SETTINGS) as table:
        table.append(result(case(1)))
        table.append(CaseResult(case(2), "crashed", "it was\nthe weather", dict.fromkeys(METRICS, float("nan"))))
    with table.path.open("a", encoding="utf-8") as file:
        file.write("paper_planar,vic,event_1000,obs")  # cut off by a full disk or a kill
    with StudyTable(tmp_path, SETTINGS) as again:
        assert again.done() == {case(1).key}
        again.append(result(case(0)))
        assert [row["seed"] for row in again.rows()] == ["1", "0"]
        again.sort()
        again.append(result(case(10)))
        again.append(result(case(2)))
        again.sort()
        assert [row["seed"] for row in again.rows()] == ["0", "1", "2", "10"]


def test_a_row_keeps_every_bit(tmp_path: Path) -> None:
    with StudyTable(tmp_path, SETTINGS) as table:
        table.append(result(case(), 0.1 + 0.2))
        assert {float(table.rows()[0][name]) for name in METRICS} == {0.1 + 0.2}


def test_a_folder_keeps_to_what_it_is_made_of(tmp_path: Path) -> None:
    with StudyTable(tmp_path, SETTINGS):
        pass
    others = {
        "same overrides": replace(SETTINGS, assignments=("object.mass=1.0",)),
        "made with numpy 2.0, expected numpy 2.1": replace(SETTINGS, versions={"numpy": "2.1"}),
        "of sensor event_1000 d1, expected sensor event_1000 d2": replace(
            SETTINGS, digests={"sensor event_1000": "d2"}
        ),
    }
    for said, other in others.items():
        with pytest.raises(InputError, match=said):
            StudyTable(tmp_path, other)
    with StudyTable(tmp_path, replace(SETTINGS, digests={"sensor ideal": "d3"})) as table:
        assert table.settings.digests == {"sensor event_1000": "d1", "sensor ideal": "d3"}
    (tmp_path / "study.json").write_text('{"assignments": []}')  # as versions before wrote it
    with pytest.raises(InputError, match="another folder"):
        StudyTable(tmp_path, SETTINGS)


def test_a_folder_that_cannot_be_written_is_one_line() -> None:
    with pytest.raises(InputError, match="--out /proc/study"):
        StudyTable(Path("/proc/study"), SETTINGS)


def test_a_folder_is_for_one_study_at_a_time(tmp_path: Path) -> None:
    with StudyTable(tmp_path, SETTINGS), pytest.raises(InputError, match=f"in use by process {os.getpid()}"):
        StudyTable(tmp_path, SETTINGS)
    with StudyTable(tmp_path, SETTINGS):
        pass


ASKED = Asked(("paper_planar",), ("classical", "vic"), ("ideal", "vision_25"), ("observer",), ("none",), 5)


def test_what_was_asked_comes_back_from_the_file(tmp_path: Path) -> None:
    asked = (ASKED, replace(ASKED, shard=(2, 3)))
    written = replace(SETTINGS, asked=asked)
    with StudyTable(tmp_path, written):
        pass
    assert Settings.read(tmp_path / "study.json") == written
    with StudyTable(tmp_path, replace(SETTINGS, asked=(ASKED, replace(ASKED, seeds=6)))) as table:
        assert table.settings.asked == (*asked, replace(ASKED, seeds=6))


def test_shards_are_all_cases_once_and_merge_to_the_whole(tmp_path: Path) -> None:
    parts = [replace(ASKED, shard=(i, 3)) for i in (1, 2, 3)]
    assert sorted((c for part in parts for c in part.cases()), key=lambda c: c.key) == sorted(
        ASKED.cases(), key=lambda c: c.key
    )
    for number, part in enumerate(parts):
        with StudyTable(tmp_path / str(number), replace(SETTINGS, asked=(part,))) as table:
            for one in part.cases():
                table.append(result(one, one.seed / 7.0))
    with StudyTable(tmp_path / "whole", replace(SETTINGS, asked=(ASKED,))) as whole:
        for one in reversed(ASKED.cases()):
            whole.append(result(one, one.seed / 7.0))
        whole.sort()
    folders = [tmp_path / name for name in "201"]
    merge(folders, tmp_path / "merged").__exit__()
    assert (tmp_path / "merged/study.csv").read_text() == whole.path.read_text()


def test_merge_refuses_what_does_not_fit(tmp_path: Path) -> None:
    for name, numpy_version, value in (("a", "2.0", 1.0), ("b", "2.1", 1.0), ("c", "2.0", 2.0)):
        with StudyTable(tmp_path / name, replace(SETTINGS, versions={"numpy": numpy_version})) as table:
            table.append(result(case(), value))
    with pytest.raises(InputError, match=r"b: got a study made with numpy 2\.1, expected numpy 2\.0"):
        merge([tmp_path / "a", tmp_path / "b"], tmp_path / "out")
    with pytest.raises(InputError, match="another result of paper_planar"):
        merge([tmp_path / "a", tmp_path / "c"], tmp_path / "out")
    with pytest.raises(InputError, match=r"nothing.study\.json"):
        merge([tmp_path / "nothing"], tmp_path / "out")


def test_a_case_runs_from_texts_alone(tmp_path: Path) -> None:
    """Files of one's own, gone before the case is loaded."""
    files = tmp_path / "task.yaml", tmp_path / "mine.yaml", tmp_path / "arm.urdf"
    for file, text in zip(
        files, (scenario_text("paper_planar"), preset_text("sensors", "event_1000"), urdf_text()), strict=True
    ):
        file.write_text(text)
    own = Case(str(files[0]), "vic", str(files[1]), "observer", "mass+", 3)
    arm = (f"bridge.robot_description_file={files[2]}",)
    contents = gather([own.scenario], [own.sensor], arm)
    before = own.load(arm)
    for file in files:
        file.unlink()
    assert own.load(contents.assignments, contents.texts) == before
    assert set(contents.digests()) == {f"scenario {files[0]}", f"sensor {files[1]}", f"arm {files[2]}"}


def test_a_worker_with_other_versions_is_named() -> None:
    check_versions(versions())
    with pytest.raises(MixedVersions, match=r"mujoco .* expected 0\.1"):
        check_versions({**versions(), "mujoco": "0.1"})
    error = pickle.loads(pickle.dumps(MixedVersions("worker on a: got b")))  # as it comes back from a worker
    assert str(error) == "worker on a: got b"


def test_progress_without_a_terminal_is_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr("slip_vic.run.progress.time.monotonic", lambda: now[0])
    written = io.StringIO()
    with progress("study", 100, 40, Console(file=written)) as report:
        for done in range(41, 101):
            now[0] += 0.5
            report(done, "1 workers died" if done > 90 else "")
    assert written.getvalue().splitlines() == [
        "study: 60 of 100 done, 2 per second, about 20 s left",
        "study: 80 of 100 done, 2 per second, about 10 s left",
        "study: 100 of 100 done, 2 per second, 1 workers died",
    ]


def test_tables_of_a_study_fit_into_80_columns_with_the_longest_names() -> None:
    def row(sensor: str, law: str, estimator: str, outcome: str, slip_mm: float) -> dict[str, str]:
        numbers = dict.fromkeys(METRICS, "0.0001") | {"slip_linear_m": str(1e-3 * slip_mm)}
        key = Case("glass_transport", law, sensor, estimator, "none", 0).key
        return dict(zip(STUDY.columns, [*key, outcome, *numbers.values(), ""], strict=True))

    rows = [
        row("force_tactile_500", "classical", "none", "ok", 5.26),
        row("force_tactile_500", "governed", "observer", "ok", 0.0),
        row("optical_flow_120", "governed", "observer", "ok", 1.0),
        row("optical_flow_120", "governed", "observer", "fault", 123.4),
    ]
    with io.StringIO() as file:
        Console(file=file, width=80).print(*summary_tables(rows), sep="\n")
        shown = file.getvalue()
    assert "…" not in shown
    assert any(line.split()[:3] == ["force_tactile_500", "classical", "1/1"] for line in shown.splitlines())
    assert any(
        line.split()[:6] == ["optical_flow_120", "governed", "1/2", "62.20", "/", "123"] for line in shown.splitlines()
    )


def test_spread_is_median_interval_and_worst() -> None:
    s = spread(range(101))
    assert s.median == 50.0
    assert s.low < 50.0 < s.high
    assert s.high < 60.0
    assert s.worst == 100.0


def test_picture_of_a_study_with_missing_numbers(tmp_path: Path) -> None:
    row = dict(zip(STUDY.columns, [*case().key, "crashed", *["nan"] * len(METRICS), "died"], strict=True))
    write_picture(tmp_path / "study.png", [row])
    assert (tmp_path / "study.png").exists()


def test_check_gives_the_bound_and_the_exit_code() -> None:
    fixed = ["--set", "controller.gains.k_s_mode=fixed"]
    arguments = ["check", "--sensor", "optical_flow_120", "--estimator", "measured"]
    refused = CliRunner().invoke(cli, [*arguments, *fixed])
    assert refused.exit_code == 2
    assert "54.8861" in refused.output
    arguments += ["--mismatch", "none", "--set", SHORT[0]]
    assert CliRunner().invoke(cli, arguments).exit_code == 0
    file = "config/paper_planar/controller_vic.yaml"
    with_file = CliRunner().invoke(cli, ["check", "--params", str(Path(__file__).parents[3] / file), *arguments[1:]])
    assert with_file.exit_code == 0
    assert "54.8861" in with_file.output


def test_check_says_which_joint_comes_near_the_end_of_its_range() -> None:
    """Limit avoidance pushes the pad off its path there, which no governor sees: seen with this very path."""
    eight = [f"controller.trajectory.{text}" for text in ("kind=lemniscate", "radius=0.06", "duration_s=8.0")]
    assert load_scenario("paper_planar").check_arm() == []
    (remark,) = load_scenario("paper_planar", assignments=eight).check_arm()
    assert remark.startswith("arm_joint4 comes to 0.047 of the end of its range")
    wide = load_scenario("paper_planar", assignments=[*eight, "controller.safety.limits.position_margin=0.04"])
    assert wide.check_arm() == []


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
