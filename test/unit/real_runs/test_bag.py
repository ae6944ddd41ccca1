"""A run of the data set's form, made up with a known slip, becomes a bag that the suite's own readers understand."""

from __future__ import annotations

import csv

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from slip_bags.reader import Bag
from slip_core.errors import InputError
from slip_vic.cli import cli
from slip_vic.page.runs import duration_s, grid, read_run
from slip_vic.presets.models import load_sensor
from tools.real_data import calibrate
from tools.real_data.bag import LATEST, sensor, write_bag
from tools.real_data.detect import observe_bag
from tools.real_data.grasp import MARKER_UP, values
from tools.real_data.runs import read_fields, read_object_motion, shear, taxels

ROWS, RATE = 150, 60.0
TURN = np.deg2rad(20.0)  # rad/s, from row 60 on
FALL = 0.01  # m/s, from row 60 on
LOST = 140


def write_csv(path, names, table):
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(table.tolist())


@pytest.fixture
def run(tmp_path):
    """A marker behind and above the pad centre; the object turns about that centre and slides down; lost in the end."""
    folder = tmp_path / "data_sample_made_up"
    folder.mkdir()
    t = np.arange(ROWS) / RATE
    since = np.maximum(0.0, t - 1.0)
    joints = np.stack([0.1 * i + 0.05 * t for i in range(7)] + [np.full(ROWS, 0.05)] * 7, axis=1)
    names = [f"{kind}_joint{i}" for kind in ("position", "velocity") for i in range(1, 8)]
    state = np.column_stack([joints, 0.6 - 0.3 * t, 0.2 - 0.4 * t, t])
    write_csv(folder / "robot_state.csv", [*names, "ee_T_03", "ee_T_13", "time"], state)

    start = Rotation.from_euler("x", 149.0, degrees=True)
    arm = np.array(
        [0.0, -values(calibrate.read()[0].standard[0])["marker_ahead"], MARKER_UP]
    )  # marker's axes: -y ahead, z up
    turned = Rotation.from_rotvec(np.outer(TURN * since, [1.0, 0.0, 0.0]))
    moved = turned.apply(arm) - arm - np.outer(FALL * since, [0.0, 0.0, 1.0])
    quat = (start * turned).as_quat()
    place = np.array([0.03, -0.03, 0.17]) + start.apply(moved)
    place[LOST:], quat[LOST:] = 1e4, [0.1, 0.9, -0.3, 0.2]
    marker = [f"marker_position_{a}" for a in "xyz"] + [f"marker_quaternion_{a}" for a in "xyzw"]
    write_csv(folder / "marker.csv", marker, np.column_stack([place, quat]))
    lost = (np.arange(ROWS) >= LOST).astype(float)
    write_csv(folder / "slip_label.csv", ["slip", "fail"], np.column_stack([since > 0.3, lost]))

    p = taxels()
    for finger, side in ((1, -1.0), (2, 1.0)):
        field = np.zeros((ROWS, 16, 3))
        field[:, :, 0] = 5.0 - side * 2e3 * since[:, None] * p[:, 1]
        field[:, :, 1] = side * 30.0 * since[:, None] + side * 2e3 * since[:, None] * p[:, 0]
        field[:, 3, :2] = np.where(since[:, None] > 0.0, 4000.0, 0.0)  # a taxel that sticks at full scale
        columns = [f"txl{i}_{a}" for i in range(1, 17) for a in "xyz"]
        write_csv(folder / f"xela_sensor{finger}.csv", columns, 16000.0 + field.reshape(ROWS, 48))
    return folder


def test_marker_gives_rotation_and_place(run):
    motion = read_object_motion(run)
    since = np.maximum(0.0, np.arange(ROWS) / RATE - 1.0)
    np.testing.assert_allclose(motion.rotation[:LOST], TURN * since[:LOST], atol=1e-9)
    assert np.isnan(motion.rotation[LOST:]).all()


def test_skin_gives_load_and_twist_in_spite_of_a_stuck_taxel(run):
    load = shear(read_fields(run))
    since = np.maximum(0.0, np.arange(ROWS) / RATE - 1.0)
    arm = np.sqrt((taxels() ** 2).sum(axis=1).mean())
    np.testing.assert_allclose(load.twist, 2e3 * since * arm, atol=0.02 * 2e3 * arm)
    # The centroid moves with the weights: a fifteenth of the stuck taxel's place times the twist.
    np.testing.assert_allclose(load.ahead, 30.0 * since, atol=1.5)
    np.testing.assert_allclose(load.down[:60], 0.0, atol=1e-9)


def test_bag_has_the_slip_at_the_pad_centre(run, tmp_path):
    """The pad relative to the object: it turns the other way, and up while the object slides down."""
    out = tmp_path / "bag"
    assert write_bag(run, out) == 3 * ROWS + 2 * LOST - (LATEST - 1)
    with Bag(out) as bag:
        truth, joints = bag.series("/slip_truth"), bag.series("/joint_states")
        cloud = next(iter(bag.messages("/tactile_1"))).value
    assert truth.count == LOST
    np.testing.assert_allclose(joints["position"][:, 0], 0.05 * np.arange(ROWS) / RATE, atol=1e-12)
    late = truth["velocity"][80:130]
    np.testing.assert_allclose(late[:, 5], -TURN, rtol=1e-6)
    np.testing.assert_allclose(late[:, 0], -FALL, rtol=1e-6)
    np.testing.assert_allclose(late[:, 1:5], 0.0, atol=1e-9)
    end = (LOST - 1) / RATE - 1.0
    np.testing.assert_allclose(truth["position"][-1], [-FALL * end, 0, 0, 0, 0, -TURN * end], atol=1e-9)
    points = np.frombuffer(bytes(cloud.data), dtype="<f4").reshape(16, 6)
    np.testing.assert_allclose(points[:, :2], taxels(), atol=1e-8)


def test_the_page_reads_it(run, tmp_path):
    out = tmp_path / "bag"
    write_bag(run, out)
    times = grid(duration_s([out]))
    shown = read_run(out, "real", times)
    assert shown.arms[0].joint_names == tuple(f"arm_joint{i}" for i in range(1, 8))
    assert np.nanmax(shown.arms[0].values["slip_deg"]) == pytest.approx(np.rad2deg(TURN * ((LOST - 1) / RATE - 1.0)))


def test_observer_finds_the_slip_in_the_bag(run, tmp_path):
    """The camera's noise is some 0.1 degrees; made up, it has none, so a little is added to the marker."""
    path = run / "marker.csv"
    lines = path.read_text().splitlines()
    rows = np.array([line.split(",") for line in lines[1:]], dtype=float)
    rows[:, 3:] += 2e-3 * np.random.default_rng(1).standard_normal((ROWS, 4))
    write_csv(path, lines[0].split(","), rows)
    write_bag(run, tmp_path / "bag")
    ((begin, end),) = observe_bag(tmp_path / "bag")
    slips_from = 1.0 + 1.0  # the bag begins at 1 s
    assert slips_from < begin < slips_from + 0.1
    assert end > slips_from + (LOST - 60) / RATE - 0.1


def test_tune_takes_the_sensor(run):
    preset = load_sensor("marker", yaml.safe_dump(sensor(run)))
    assert preset.slip.rate_hz == RATE
    assert preset.slip.latency_s == pytest.approx(1.5 / RATE)


def test_commands_for_runs_of_our_own_say_no_in_one_line(run, tmp_path):
    """It has no controller to run again, and is neither a sensor nor a world."""
    write_bag(run, tmp_path / "bag")
    for arguments, says in (
        (("bag", "verify"), "expected a bag of `slip-vic run --record`"),
        (("tune", "--sensor"), ".yaml file)"),
        (("tune", "--scenario"), ".yaml file)"),
    ):
        done = CliRunner().invoke(cli, [*arguments, str(tmp_path / "bag")])
        assert isinstance(done.exception, InputError)
        assert says in str(done.exception)
        assert "\n" not in str(done.exception)


def test_refuses_what_is_no_run_and_what_exists(run, tmp_path):
    with pytest.raises(InputError, match="no such file"):
        write_bag(tmp_path, tmp_path / "bag")
    with pytest.raises(InputError, match="URDF"):
        write_bag(run, tmp_path / "bag", tmp_path / "none.urdf")
    (tmp_path / "there").mkdir()
    with pytest.raises(InputError, match="exists"):
        write_bag(run, tmp_path / "there")
