"""The public names: a scenario, its run, a bag; against each other."""

import math

import numpy as np
import pytest

import slip_vic
from slip_core.errors import InputError

SHORT = "bridge.duration_s=0.4"


def test_every_public_name_is_there_and_says_what_it_does() -> None:
    assert len(slip_vic.__all__) <= 15
    assert sorted(slip_vic.__all__) == slip_vic.__all__
    for name in slip_vic.__all__:
        assert getattr(slip_vic, name).__doc__
    assert set(slip_vic.__all__) <= set(dir(slip_vic))
    with pytest.raises(AttributeError, match="has no attribute 'lode'"):
        slip_vic.lode  # noqa: B018


@pytest.fixture(scope="module")
def run() -> slip_vic.Run:
    return slip_vic.load("paper_planar", law="vic", sensor="vision_60", seed=3, set=[SHORT, "object.mass=0.45"]).run()


def test_a_scenario_has_its_parameters() -> None:
    scenario = slip_vic.load("paper_planar", law="classical", set=["object.mass=0.6", "bridge.grip.force=0.7"])
    assert scenario.bridge.object.mass == scenario.controller.object.mass == 0.6
    assert scenario.bridge.grip.force == 0.7
    assert scenario.law == scenario.controller.controller == "classical"


def test_every_tick_is_a_row(run: slip_vic.Run) -> None:
    frame = run.frame()
    assert len(frame) == 400
    np.testing.assert_allclose(np.diff(frame.time_s), 1e-3, rtol=1e-9)
    assert frame.slip_linear_mm.iloc[-1] == run.slip_mm
    assert frame.slip_angular_deg.iloc[-1] == pytest.approx(run.slip_deg, rel=1e-12)
    error = np.linalg.norm(frame[["e_x", "e_y", "e_z"]].to_numpy(), axis=1)
    assert np.nanmax(error) == run.worst("off_path_m")
    assert {"q_7", "qd_7", "effort_7", "K_x", "gate", "wrench_rz", "object_z"} <= set(frame.columns)


def test_the_run_says_how_it_ended(run: slip_vic.Run) -> None:
    assert (run.outcome, run.reason) == ("ok", "")
    assert math.isnan(run.arrival_s)  # 0.4 s of a motion of 2 s
    assert run.modes[""][-1][1].startswith("ACTIVE")
    assert "paper_planar" in repr(run)
    assert f"{run.slip_mm:.2f}" in repr(run)


def test_equal_calls_give_equal_bits(run: slip_vic.Run) -> None:
    again = slip_vic.load("paper_planar", law="vic", sensor="vision_60", seed=3, set=[SHORT, "object.mass=0.45"]).run()
    assert again.frame().equals(run.frame())
    other = slip_vic.load("paper_planar", law="vic", sensor="vision_60", seed=4, set=[SHORT, "object.mass=0.45"]).run()
    assert not other.frame().equals(run.frame())


def test_page_is_written(run: slip_vic.Run, tmp_path) -> None:
    page = run.page(tmp_path / "run.html").read_text()
    assert "paper_planar" in page
    assert f"{run.slip_mm:.2f}" in page
    with pytest.raises(InputError, match="a folder that can be written"):
        run.page("/proc/run.html")


def test_a_bag_is_read_as_tables() -> None:
    topics = slip_vic.read_bag("bags/paper_planar_vic")
    assert set(topics.topic) >= {"/joint_states", "/effort_command"}
    states = slip_vic.read_bag("bags/paper_planar_vic", "/joint_states")
    assert len(states) == 1000
    assert any(column.startswith("position") for column in states.columns)
    with pytest.raises(InputError, match="/joint_states"):
        slip_vic.read_bag("bags/paper_planar_vic", "/joint_state")
