"""The public names: a scenario, its run, the law on arrays, a bag; against the cycle and against each other."""

import math

import numpy as np
import pytest

import slip_vic
from slip_core.errors import InputError
from slip_vic.run.in_process import run_in_process

SHORT = "bridge.duration_s=0.4"


def test_every_public_name_is_there_and_says_what_it_does() -> None:
    assert len(slip_vic.__all__) <= 17
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


def test_the_law_on_arrays_is_the_law_of_the_cycle() -> None:
    scenario = slip_vic.load("paper_planar", law="vic", set=[SHORT])
    controller, gains = scenario.controller, scenario.controller.gains
    compared = 0
    for tick in run_in_process(scenario):
        arm, made = tick.result.arm, tick.result.record
        if not made.ok or tick.outputs.tick % 40:
            continue
        inner = made.gains.gains
        n = 7
        told = slip_vic.evaluate_law(
            q=tick.result.joint.position, qd=tick.result.joint.velocity, J=arm.J[:, :n], M=arm.M[:n, :n],
            bias=arm.bias[:n], jdot_qd=arm.jdot_qd, position=arm.position, rotation=arm.rotation,
            desired_position=made.reference.position, desired_rotation=made.reference.rotation,
            desired_twist=made.reference.twist, desired_acceleration=made.reference.acceleration,
            wrench=made.samples[0].wrench, slip_velocity=made.samples[0].slip_twist,
            slip_position=made.slips[0].position, slip_rotation=made.slips[0].rotation,
            mass=controller.object.mass, inertia=np.diag(controller.object.inertia[:3]),
            grasp_position=controller.contacts.position[:3], grasp_rotation=np.diag([-1.0, -1.0, 1.0]),
            slip_axes=controller.contacts.slip_axes[:6], gravity=controller.gravity,
            stiffness=gains.stiffness, damping=gains.damping, desired_inertia=gains.inertia,
            gamma_k=inner.gamma_k, gamma_d=inner.gamma_d, alpha=inner.alpha, k_s=inner.k_s,
        )  # fmt: skip
        np.testing.assert_allclose(told.acceleration, made.law.a_C, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(told.K, made.law.K, rtol=1e-12)
        np.testing.assert_allclose(told.e, made.law.e, rtol=1e-9, atol=1e-15)
        assert told.gate == pytest.approx(float(made.law.gate), rel=1e-12)
        compared += 1
    assert compared == 10


def test_the_law_refuses_shapes_and_numbers_that_are_none() -> None:
    good = {
        "q": np.zeros(6), "qd": np.zeros(6), "J": np.eye(6), "M": np.eye(6), "bias": np.zeros(6),
        "position": np.zeros(3), "rotation": np.eye(3), "desired_position": [0.1, 0.0, 0.0],
        "desired_rotation": np.eye(3), "wrench": np.zeros(6), "slip_velocity": np.zeros(6), "mass": 0.5,
        "inertia": 1e-3 * np.eye(3), "grasp_position": np.zeros(3), "stiffness": [10.0] * 6, "damping": [2.0] * 6,
        "desired_inertia": [0.5] * 6,
    }  # fmt: skip
    # M = J = 1, no wrench: the effort is the acceleration, K e / M_D = 10 * 0.1 / 0.5
    np.testing.assert_allclose(slip_vic.evaluate_law(**good).effort, [2.0, 0, 0, 0, 0, 0], atol=1e-12)
    with pytest.raises(InputError, match="the shapes that its docstring names"):
        slip_vic.evaluate_law(**good | {"wrench": np.zeros(5)})
    with pytest.raises(InputError, match="no finite effort"):
        slip_vic.evaluate_law(**good | {"wrench": np.full(6, np.nan)})


def test_a_bag_is_read_as_tables() -> None:
    topics = slip_vic.read_bag("bags/paper_planar_vic")
    assert set(topics.topic) >= {"/joint_states", "/effort_command"}
    states = slip_vic.read_bag("bags/paper_planar_vic", "/joint_states")
    assert len(states) == 1000
    assert any(column.startswith("position") for column in states.columns)
    with pytest.raises(InputError, match="/joint_states"):
        slip_vic.read_bag("bags/paper_planar_vic", "/joint_state")
