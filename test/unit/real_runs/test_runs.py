"""A run of the data set's form with a known slip, and damaged run files."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slip_core.errors import InputError
from tools.real_data import calibrate
from tools.real_data.grasp import MARKER_UP, values
from tools.real_data.runs import pad_motion, read_fields, read_object_motion, read_pad_motion, shear, taxels

ROWS, RATE, LOST = 150, 60.0, 140
TURN, FALL = np.deg2rad(20.0), 0.01  # rad/s, m/s, from 1 s on
SINCE = np.maximum(0.0, np.arange(ROWS) / RATE - 1.0)


def write_csv(path, names, table):
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(table.tolist())


@pytest.fixture
def run(tmp_path):
    """A marker behind and above the pad centre; the object turns about that centre and slides down; lost in the end."""
    start = Rotation.from_euler("x", 149.0, degrees=True)
    marker_ahead = values(calibrate.read()[0].standard[0])["marker_ahead"]
    arm = np.array([0.0, -marker_ahead, MARKER_UP])  # marker's axes: -y ahead, z up
    turned = Rotation.from_rotvec(np.outer(TURN * SINCE, [1.0, 0.0, 0.0]))
    quat = (start * turned).as_quat()
    moved = turned.apply(arm) - arm - np.outer(FALL * SINCE, [0.0, 0.0, 1.0])
    place = np.array([0.03, -0.03, 0.17]) + start.apply(moved)
    place[LOST:], quat[LOST:] = 1e4, [0.1, 0.9, -0.3, 0.2]
    marker = [f"marker_position_{a}" for a in "xyz"] + [f"marker_quaternion_{a}" for a in "xyzw"]
    write_csv(tmp_path / "marker.csv", marker, np.column_stack([place, quat]))
    lost = (np.arange(ROWS) >= LOST).astype(float)
    write_csv(tmp_path / "slip_label.csv", ["slip", "fail"], np.column_stack([SINCE > 0.3, lost]))
    p = taxels()
    for finger, side in ((1, -1.0), (2, 1.0)):
        field = np.zeros((ROWS, 16, 3))
        field[:, :, 0] = 5.0 - side * 2e3 * SINCE[:, None] * p[:, 1]
        field[:, :, 1] = side * 30.0 * SINCE[:, None] + side * 2e3 * SINCE[:, None] * p[:, 0]
        field[:, 3, :2] = np.where(SINCE[:, None] > 0.0, 4000.0, 0.0)  # a taxel that sticks at full scale
        columns = [f"txl{i}_{a}" for i in range(1, 17) for a in "xyz"]
        write_csv(tmp_path / f"xela_sensor{finger}.csv", columns, 16000.0 + field.reshape(ROWS, 48))
    return tmp_path


def test_rotation_of_the_marker(run):
    motion = read_object_motion(run)
    np.testing.assert_allclose(motion.rotation[:LOST], TURN * SINCE[:LOST], atol=1e-9)
    assert np.isnan(motion.rotation[LOST:]).all()


def test_shear_with_a_stuck_taxel(run):
    load, arm = shear(read_fields(run)), np.sqrt((taxels() ** 2).sum(axis=1).mean())
    np.testing.assert_allclose(load.twist, 2e3 * SINCE * arm, atol=0.02 * 2e3 * arm)
    # The centroid moves with the weights: a fifteenth of the stuck taxel's place times the twist.
    np.testing.assert_allclose(load.ahead, 30.0 * SINCE, atol=1.5)
    np.testing.assert_allclose(load.down[:60], 0.0, atol=1e-9)


def test_acceleration_of_a_known_path():
    t = np.arange(0.0, 2.0, 1.0 / 60.0)
    pads = pad_motion(t, np.stack([0.3 * t**2, np.zeros(t.size)], axis=1))
    np.testing.assert_allclose(pads.acceleration, 0.6, atol=1e-6)
    np.testing.assert_allclose(pads.speed[5:-5], 0.6 * t[5:-5], atol=1e-3)


@pytest.mark.parametrize(("text", "word"), [
    ("", "no column"),
    ("time,ee_T_03\n0,1\n", "no column ee_T_13"),
    ("time,ee_T_03,ee_T_13\n" + "0.0,1,1\n" * 40, "usable rows"),
    ("time,ee_T_03,ee_T_13\n" + "".join(f"{16_666_667 * i},1,1\n" for i in range(40)), "stamps in seconds"),
    ("time,ee_T_03,ee_T_13\n" + "".join(f"{i / 60},{1e9 * (i % 2)},1\n" for i in range(40)), "in metres"),
    ('time,ee_T_03,ee_T_13\n"' + "1" * 200_000, "field larger"),
])  # fmt: skip
def test_files_that_are_no_run(tmp_path, text, word):
    (tmp_path / "robot_state.csv").write_text(text)
    with pytest.raises(InputError, match=word):
        read_pad_motion(tmp_path)
