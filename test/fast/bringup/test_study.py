"""The study: cases, mismatches, a table that survives interruptions, workers that die, and the verdict on gains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from slip_bringup.cli import cli
from slip_bringup.study.cases import MISMATCHES, Case, all_cases
from slip_bringup.study.run_case import METRICS, CaseResult, run_case
from slip_bringup.study.summary import spread, write_picture
from slip_bringup.study.table import COLUMNS, StudyTable
from slip_core.errors import InputError

ISSUE_COLUMNS = (
    "scenario,controller,sensor,estimator,mismatch,seed,outcome,slip_linear_m,slip_angular_rad,slip_speed_peak_m_s,"
    "tracking_rms_m,final_error_m,final_error_rad,attitude_excursion_rad"
)
SHORT = ("bridge.duration_s=0.05",)


def case(seed: int = 0, estimator: str = "observer", mismatch: str = "none", sensor: str = "event_1000") -> Case:
    return Case("paper_planar", sensor, estimator, mismatch, seed)


def result(of: Case, value: float = 1.0) -> CaseResult:
    return CaseResult(of, "ok", "", dict.fromkeys(METRICS, value))


def test_columns_are_the_promised_ones() -> None:
    assert ",".join(COLUMNS).startswith(ISSUE_COLUMNS)


def test_every_combination_once() -> None:
    cases = all_cases(["paper_planar"], ["ideal", "vision_25"], ["classical", "observer"], ["none", "mass+"], 3)
    assert len(cases) == len(set(cases)) == 24
    with pytest.raises(InputError, match=r"mass\+"):
        all_cases(["paper_planar"], ["ideal"], ["observer"], ["mass"], 1)


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
    assert all(np.isfinite(value) for value in good.metrics.values())
    refused = run_case(case(estimator="measured"), (*SHORT, "controller.gains.k_s_mode=fixed"))
    assert refused.outcome == "refused"
    assert "k_s" in refused.reason
    assert run_case(case(), ("bridge.duration_s=nonsense",)).outcome == "refused"


def test_a_simulation_that_diverges_is_no_refusal() -> None:
    """Gravity that no arm bears: the state stops being physical in the first tick."""
    result = run_case(case(), (*SHORT, "bridge.gravity=[0.0, 0.0, -1e6]"))
    assert result.outcome == "diverged"
    assert "simulation diverged" in result.reason


def test_a_table_goes_on_where_it_stopped(tmp_path: Path) -> None:
    table = StudyTable(tmp_path, ())
    table.append(result(case(0)))
    table.append(CaseResult(case(1), "crashed", "it was\nthe weather", dict.fromkeys(METRICS, float("nan"))))
    with table.path.open("a", encoding="utf-8") as file:
        file.write("paper_planar,vic,event_1000,obs")  # cut off by a full disk or a kill
    again = StudyTable(tmp_path, ())
    assert again.done() == {case(0).key}
    again.append(result(case(1)))
    assert [row["seed"] for row in again.rows()] == ["0", "1"]


def test_a_folder_keeps_to_one_set_of_overrides(tmp_path: Path) -> None:
    StudyTable(tmp_path, ())
    with pytest.raises(InputError, match="another folder"):
        StudyTable(tmp_path, ("object.mass=1.0",))


def test_spread_is_median_interval_and_worst() -> None:
    s = spread(range(101))
    assert s.median == 50.0
    assert s.low < 50.0 < s.high
    assert s.high < 60.0
    assert s.worst == 100.0


def test_picture_of_a_study_with_missing_numbers(tmp_path: Path) -> None:
    row = dict(zip(COLUMNS, [*case().key, "crashed", *["nan"] * len(METRICS), "died"], strict=True))
    write_picture(tmp_path / "study.png", [row])
    assert (tmp_path / "study.png").exists()


def test_check_gives_the_bound_and_the_exit_code() -> None:
    fixed = ["--set", "controller.gains.k_s_mode=fixed"]
    arguments = ["check", "--sensor", "optical_flow_120", "--estimator", "measured"]
    refused = CliRunner().invoke(cli, [*arguments, *fixed])
    assert refused.exit_code == 2
    assert "54.8861" in refused.output
    assert CliRunner().invoke(cli, arguments).exit_code == 0
    file = "config/paper_planar/controller_vic.yaml"
    with_file = CliRunner().invoke(cli, ["check", "--params", str(Path(__file__).parents[3] / file), *arguments[1:]])
    assert with_file.exit_code == 0
    assert "54.8861" in with_file.output
