"""Retimed paths: against the governor in closed loop, MuJoCo's inverse dynamics, and what is to be refused."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pandas as pd
import pytest
import yaml
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from slip_core.arrays import Array, matrix_from_quat_xyzw
from slip_core.errors import InputError
from slip_core.types import PadMotion
from slip_vic.cli import cli
from slip_vic.retime.certificate import Motion, certified, load_shares, motion_of, pad_wrench
from slip_vic.retime.command import governed
from slip_vic.retime.path import POSE_COLUMNS, PadPath, Points, deviation, read_points, smooth_time
from slip_vic.run.in_process import run_in_process
from slip_vic.scenarios.reach import pad_path
from slip_vic.scenarios.scenario import Scenario, load
from slip_vic_controller.config.controller import ArmController
from slip_vic_controller.governor.plan import GRID_POINTS

CLOSE = 0.02
"""Share of the arrival in closed loop: a promise of the command."""
EXACT = 1e-9
RESTS_S = 0.3
"""So long at rest, the path has ended."""
SCENARIOS = ("paper_planar", "vertical_plane", "glass_transport")


def scenario(name: str, timing: str = "slow_down", *assignments: str) -> Scenario:
    return load(name, law="governed", set=(f"controller.governor.mode={timing}", *assignments))


def planned_poses(loaded: Scenario, count: int = 120) -> Points:
    """Return the built-in path of a scenario as poses, in its own time."""
    x, R, _ = governed(loaded, "slow_down").robot.frame(np.array(loaded.bridge.initial_position))
    times, values = pad_path(loaded.controller.trajectory, count)
    turned = Rotation.from_rotvec(values[:, 3:]) * Rotation.from_matrix(R)
    return Points(times, np.hstack((x + values[:, :3], turned.as_quat())), POSE_COLUMNS)


def retimed_motion(poses: Points, controller: ArmController) -> Motion:
    return motion_of(certified(PadPath(poses), controller), controller.params.control_period_s)


def arrival_in_closed_loop(loaded: Scenario) -> float:
    """Return when the governed path is at rest at its end, counted from when its plan was ready [s]."""
    began, ended = 0.0, 0.0
    for tick in run_in_process(loaded):
        governor = tick.result.record.governor
        if governor.path_rate > 0.0:
            began = began or tick.time_s
            ended = tick.time_s
        if began and tick.time_s > ended + RESTS_S:
            break
    return ended - began


def test_a_turned_world_has_turned_wrenches() -> None:
    settings = ("object.inertia=[1e-3,2e-3,2.5e-3,1e-4,2e-4,3e-4]", "gravity=[0,0,0]")
    params, rng = load("paper_planar", set=settings).controller, np.random.default_rng(0)
    x, (v, a), (Q, R) = rng.normal(size=3), rng.normal(size=(2, 6)), Rotation.random(2, rng=1).as_matrix()
    turn = np.kron(np.eye(2), Q)
    turned = pad_wrench(params, PadMotion(Q @ x, Q @ R, turn @ v, turn @ a))
    np.testing.assert_allclose(turned, turn @ pad_wrench(params, PadMotion(x, R, v, a)), rtol=EXACT)


def load_by_mujoco(loaded: Scenario, motion: Motion) -> Array:
    """Return the load of every sample: MuJoCo's inverse dynamics of the free object that moves with the pad [N]."""
    p = loaded.controller
    spec = mujoco.MjSpec()
    spec.option.gravity = p.gravity
    body = spec.worldbody.add_body(name="object")
    body.mass, body.fullinertia, body.explicitinertial = p.object.mass, p.object.inertia, True
    body.ipos = np.zeros(3)
    body.add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    o_R_p, lever = matrix_from_quat_xyzw(p.contacts.orientation_xyzw[:4]), np.array(p.contacts.position[:3])
    slips, loads = np.array(p.contacts.slip_axes[:6], dtype=float), []
    for pad in map(PadMotion, *motion.pad):
        R_o = pad.rotation @ o_R_p.T
        r, w, alpha = R_o @ lever, pad.twist[3:], pad.acceleration[3:]
        data.qpos[:3] = pad.position - r
        mujoco.mju_mat2Quat(data.qpos[3:], R_o.ravel())
        data.qvel[:3], data.qvel[3:] = pad.twist[:3] - np.cross(w, r), R_o.T @ w
        data.qacc[:3] = pad.acceleration[:3] - np.cross(alpha, r) - np.cross(w, np.cross(w, r))
        data.qacc[3:] = R_o.T @ alpha
        mujoco.mj_inverse(model, data)
        force, torque = data.qfrc_inverse[:3].copy(), R_o @ data.qfrc_inverse[3:]
        torque = torque - np.cross(r, force)
        on_pad = np.concatenate((pad.rotation.T @ force, pad.rotation.T @ torque / p.governor.torsional_radius))
        loads.append(np.linalg.norm(slips * on_pad))
    return np.array(loads)


@pytest.mark.parametrize(
    ("name", "timing"), [*((name, "slow_down") for name in SCENARIOS), ("glass_transport", "time_optimal")]
)
def test_arrival_is_that_of_the_closed_loop_and_no_load_is_above_the_margin(name: str, timing: str) -> None:
    loaded = scenario(name, timing)
    controller = governed(loaded, timing)
    params, motion = controller.params, retimed_motion(planned_poses(loaded), controller)
    reference = arrival_in_closed_loop(loaded)
    assert abs(motion.times[-1] - reference) <= CLOSE * reference
    by_mujoco = load_by_mujoco(loaded, motion)
    np.testing.assert_allclose(by_mujoco, load_shares(params, motion) * params.governor.friction_limit, atol=EXACT)
    assert by_mujoco.max() <= params.governor.margin * params.governor.friction_limit
    end = planned_poses(loaded).values[-1, :3]
    np.testing.assert_allclose(motion.pad.position[-1], end, atol=1e-6)
    assert np.abs(motion.pad.twist[-1]).max() < 1e-3


def test_velocities_and_accelerations_are_the_derivatives_of_the_motion() -> None:
    loaded = scenario("paper_planar")
    motion = retimed_motion(planned_poses(loaded), governed(loaded, "slow_down"))
    x, v, h = motion.position, motion.velocity, motion.times[1] - motion.times[0]
    np.testing.assert_allclose((x[2:] - x[:-2]) / (2 * h), v[1:-1], atol=2e-4)
    half_a_step = 0.5 * np.abs(np.diff(motion.acceleration, axis=0)).max()  # velocities are sums of accelerations
    np.testing.assert_allclose((v[2:] - v[:-2]) / (2 * h), motion.acceleration[1:-1], atol=1.01 * half_a_step)


TURN = 0.6


def turned(source: Path, loaded: Scenario, seconds: float) -> Array:
    """Write a turn of the first joint, about the vertical, so that the pads stay level; return where it ends [rad]."""
    q = np.array(loaded.bridge.initial_position)
    to = q + np.array([TURN, 0, 0, 0, 0, 0, 0])
    share = np.linspace(0.0, 1.0, 60)
    smooth = share**3 * (10 - 15 * share + 6 * share**2)
    table = pd.DataFrame(q + smooth[:, None] * (to - q), columns=list(loaded.controller.joint_names))
    table.insert(0, "time", seconds * share)
    table.to_csv(source, index=False)
    return to


def test_a_joint_that_would_be_too_fast_is_named_with_its_share(tmp_path: Path) -> None:
    loaded = scenario("paper_planar")
    turned(tmp_path / "path.csv", loaded, 0.4)
    assert "a folder that can be written" in refused(tmp_path / "path.csv", "-o", "/proc/out")
    much = ("--set", "controller.governor.friction_limit=100.0")
    output, data, _ = retime(tmp_path / "path.csv", tmp_path / "out", *much)
    limit = governed(loaded, "slow_down").robot.velocity_limit[0]
    assert data["peak_velocity_share"] == pytest.approx(1.875 * TURN / 0.4 / limit, rel=0.01)
    share, load = 100.0 * data["peak_velocity_share"], 100.0 * data["peak_share"]
    assert f"\nwarning: arm_joint1 would need {share:.0f} % of its velocity limit\n" in output
    assert f"\nload at most {load:.2f} % of the friction, at {data['peak_at_s']:.3f} s\n" in output
    degrees = np.degrees(data["deviation_rad"])
    assert f"\nat most {degrees:.2g} degrees from the straight lines between the points\n" in output


def test_a_path_of_joints_gives_the_same_timing_as_that_of_the_pad(tmp_path: Path) -> None:
    loaded, source = scenario("paper_planar"), tmp_path / "path.csv"
    to = turned(source, loaded, 1.5)
    _, data, result = retime(source, tmp_path / "a")
    assert data["holds"]
    assert data["peak_share"] <= data["margin"]
    assert data["arrival_s"] > 1.5
    assert 0.0 < data["peak_effort_share"] < 1.0
    np.testing.assert_allclose(result.iloc[-1, 1:8].to_numpy(dtype=float), to, atol=1e-6)
    assert data["deviation"] < 1e-6
    goal = yaml.safe_load((tmp_path / "a" / "follow_joint_trajectory.yaml").read_text())["trajectory"]
    assert goal["joint_names"] == list(loaded.controller.joint_names)
    last = goal["points"][-1]
    np.testing.assert_allclose(last["positions"], to, atol=1e-6)
    arrival = last["time_from_start"]["sec"] + 1e-9 * last["time_from_start"]["nanosec"]
    assert arrival == pytest.approx(data["arrival_s"])


def retime(source: Path, out: Path, *words: str) -> tuple[str, dict[str, Any], pd.DataFrame]:
    """Return what the command prints, its certificate and its trajectory."""
    done = CliRunner().invoke(cli, ["retime", str(source), "-o", str(out), *words])
    assert done.exit_code == 0, done.exception
    return done.output, json.loads((out / "certificate.json").read_text()), pd.read_csv(out / "trajectory.csv")


def refused(*arguments: object) -> str:
    done = CliRunner().invoke(cli, ["retime", *map(str, arguments)])
    assert isinstance(done.exception, InputError), done.output
    return str(done.exception)


def test_a_weight_that_friction_cannot_carry_is_refused_with_its_place(tmp_path: Path) -> None:
    loaded, source = scenario("vertical_plane"), tmp_path / "path.csv"
    poses = planned_poses(loaded)
    table = pd.DataFrame(poses.values, columns=list(POSE_COLUMNS))
    table.insert(0, "time", poses.times)
    table.to_csv(source, index=False)
    words = ("--scenario", "vertical_plane", "-o", str(tmp_path / "out"))
    text = refused(source, *words, "--set", "controller.governor.friction_limit=1.0")
    assert "holding the weight needs" in text
    place = re.search(r"at ([\d.]+) s", text)
    assert place is not None
    assert float(place[1]) == pytest.approx(poses.times[-1], rel=1.0 / GRID_POINTS)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("a,b\n0,1\n1,2\n", "the joints"),
        ("time,a\n0,1\n1,1\n", "a path that moves"),
        ("time,a\n0,1\n", "at least 2"),
        ("time,a\n0,1\n0,2\n", "growing times"),
        ("time,a\n0,1\n1,nan\n", "a number in each column"),
        ("time,a\n0,1\n1,1e308\n", "none beyond 1000"),
        ("time,a\n0,True\n1,True\n", "a header and numbers"),
        ("time,a\n0,1\n1,x\n", "a header and numbers"),
        ("time,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0,0\n", "unit quaternions"),
        ("time,x,y,z,qx,qy,qz,qw\n0,0,0,0,0,0,0,1\n1,0,0,0,0,0,1,0\n", "half a revolution"),
    ],
)
def test_what_is_no_path_is_refused(tmp_path: Path, text: str, what: str) -> None:
    source = tmp_path / "path.csv"
    source.write_text(text)
    assert what in refused(source)


def test_several_arms_are_refused_with_the_reason() -> None:
    with pytest.raises(InputError, match="several arms"):
        governed(load("pane_two_arms_flat", law="governed"), "slow_down")


def test_a_path_with_noise_is_refused(tmp_path: Path) -> None:
    rng, loaded = np.random.default_rng(2), scenario("paper_planar")
    poses = planned_poses(loaded)
    poses.times[:] *= 0.1
    poses.values[:, :3] += 1e-3 * rng.normal(size=(len(poses.times), 3))
    with pytest.raises(InputError, match="smooth"):
        certified(PadPath(poses), governed(loaded, "time_optimal"))


def line(source: Path, rows: np.ndarray, *, times: np.ndarray | None = None) -> Path:
    """Write poses on a line; rows (m,): metres along x from the start of paper_planar."""
    first = planned_poses(scenario("paper_planar"), 2).values[0]
    table = pd.DataFrame(np.tile(first, (len(rows), 1)), columns=list(POSE_COLUMNS))
    table["x"] += rows
    if times is not None:
        table.insert(0, "time", times)
    table.to_csv(source, index=False)
    return source


EVEN = np.linspace(0.0, 0.2, 21)


@pytest.mark.parametrize(
    ("rows", "times"),
    [
        (EVEN, np.linspace(0.0, 4.0, 21)),
        (EVEN, None),
        (np.append(EVEN, 0.2), np.append(np.linspace(0.0, 4.0, 21), 4.0)),
    ],
    ids=["constant speed", "no times", "equal last times"],
)
def test_even_steps_are_retimed(tmp_path: Path, rows: Array, times: Array | None) -> None:
    _, data, table = retime(line(tmp_path / "path.csv", rows, times=times), tmp_path / "out")
    assert data["holds"]
    assert data["deviation"] < 1e-9
    x = table["x"].to_numpy()
    assert np.ptp(x) == pytest.approx(0.2, abs=1e-9)
    assert np.diff(x).min() > -1e-9, "backwards"


@pytest.mark.parametrize("seconds", [1.0, 0.1, 1e-6])
def test_times_too_short_for_friction_give_the_fastest_motion(tmp_path: Path, seconds: float) -> None:
    arrivals = []
    for times in (None, np.linspace(0.0, seconds, 21)):
        _, data, _ = retime(line(tmp_path / "path.csv", EVEN, times=times), tmp_path / "out")
        assert data["holds"]
        arrivals.append(data["arrival_s"])
    assert arrivals[1] == pytest.approx(arrivals[0], rel=0.01)


def test_a_wait_stays_a_wait(tmp_path: Path) -> None:
    rows, times = np.insert(EVEN, 10, EVEN[10]), np.concatenate((0.2 * np.arange(11), 2.5 + 0.2 * np.arange(11)))
    _, _, table = retime(line(tmp_path / "path.csv", rows, times=times), tmp_path / "out")
    x = table["x"].to_numpy() - table["x"][0]
    assert np.diff(x).min() > -1e-9, "backwards"
    rests = table["time"][np.abs(x - EVEN[10]) < 1e-9]
    assert np.ptp(rests) >= 0.499
    assert np.ptp(x) == pytest.approx(0.2, abs=1e-9)


def test_smooth_time_inverts_the_motion_of_least_jerk() -> None:
    share = np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose(smooth_time(share**3 * (10 - 15 * share + 6 * share**2)), share, atol=1e-12)


def test_a_path_that_bends_too_much_between_its_points_is_refused(tmp_path: Path) -> None:
    source = line(tmp_path / "path.csv", EVEN)
    table = pd.read_csv(source)
    table["y"] += np.maximum(0.0, EVEN - 0.1)
    table.to_csv(source, index=False)
    assert "a smooth curve 1.1 mm" in refused(source)


def test_deviation_is_the_sagitta_of_an_arc() -> None:
    angles, sagitta = np.linspace(0.0, 0.4, 21), 0.3 * (1.0 - np.cos(0.01))
    arc = 0.3 * np.stack((np.cos(angles), np.sin(angles), 0.0 * angles), axis=1)
    for turns in (0.0, 1.0):
        values = np.hstack((arc, Rotation.from_rotvec(turns * arc).as_quat()))
        points = Points(smooth_time(np.linspace(0.0, 1.0, 21)), values, POSE_COLUMNS)
        assert deviation(points, PadPath(points)) == pytest.approx((sagitta, turns * sagitta), rel=0.05)


def test_a_path_that_lasts_too_long_is_refused(tmp_path: Path) -> None:
    assert "times are in seconds" in refused(line(tmp_path / "path.csv", EVEN, times=np.linspace(0.0, 3e5, 21)))


def test_a_path_that_turns_back_rests_there(tmp_path: Path) -> None:
    _, _, table = retime(line(tmp_path / "path.csv", np.concatenate((EVEN, EVEN[-2::-1]))), tmp_path / "out")
    assert np.ptp(table["x"]) == pytest.approx(0.2, abs=1e-9)


def test_points_are_read_as_they_are_written(tmp_path: Path) -> None:
    source = tmp_path / "path.csv"
    source.write_text("time, b, a\n 2.0, 1, 2\n 3.5, 3, 4\n")
    for order, values in ((("b", "a"), [[1.0, 2.0], [3.0, 4.0]]), (("a", "b"), [[2.0, 1.0], [4.0, 3.0]])):
        points = read_points(source, order)
        assert points.names == order
        assert points.times.tolist() == [0.0, 1.5]
        assert points.values.tolist() == values
