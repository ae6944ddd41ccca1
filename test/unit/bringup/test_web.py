"""What the page is made of: the data block, the scripts from other packages, the arm, the series of a recorded run."""

import base64
import gzip
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio
import pytest
from scipy.spatial.transform import Rotation

from slip_core.errors import InputError
from slip_core.types import AXES
from slip_description import urdf_text
from slip_vic.page import require_page, scripts
from slip_vic.page.packing import ARRAY, Packer
from slip_vic.page.page import summaries, write_page
from slip_vic.page.runs import grid, on_grid, plot_series, series_of
from slip_vic.page.urdf import links_of
from slip_vic.run.data import ArmData, Channel, read_data
from slip_vic.run.metrics import arrival_s, load_ratio, off_goal, summarise
from test.support.two_arms import two_arms

BAGS = Path(__file__).parents[3] / "bags"


def unpack(block: bytes) -> Any:
    """Return the header with its arrays in place, as the page reads it."""
    length = int.from_bytes(block[:4], "little")

    def revive(found: dict[str, Any]) -> object:
        if ARRAY not in found:
            return found
        kind, offset, count = found[ARRAY]
        return np.frombuffer(block, f"<{kind}", count, 4 + length + offset)

    return json.loads(block[4 : 4 + length], object_hook=revive)


def test_a_block_gives_back_what_was_packed() -> None:
    packer = Packer()
    header = {"a": packer.add(np.eye(3)), "n": [1, packer.add(np.arange(5))], "x": packer.add(np.array([np.nan]))}
    back = unpack(packer.pack(header))
    np.testing.assert_array_equal(back["a"], np.eye(3).ravel())
    assert back["n"][1].tolist() == [0, 1, 2, 3, 4]
    assert np.isnan(back["x"][0])


def test_scripts_are_found_with_their_licences() -> None:
    three, (uplot, style) = scripts.three(), scripts.uplot()
    assert "SPDX-License-Identifier: MIT" in three[:200]
    assert three.count("\n") == 5, "the licence and one line: nothing of the page it comes from"
    assert "WebGLRenderer" in three
    assert "var uPlot" in uplot
    assert ".u-over" in style


def test_a_missing_extra_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"^the page needs trimesh: pip install 'slip-vic\[page\]'$"):
        require_page()


def test_a_wheel_without_the_script_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    spec = SimpleNamespace(origin=str(tmp_path / "__init__.py"))
    monkeypatch.setattr("importlib.util.find_spec", lambda _: spec)
    with pytest.raises(InputError, match=r"script in package trimesh.*requirements\.lock"):
        scripts.three()


def test_links_are_where_pinocchio_has_them() -> None:
    links, missing = links_of(urdf_text(), Packer())
    assert missing == []
    model = pinocchio.buildModelFromXML(urdf_text())
    data = model.createData()
    q = np.linspace(-0.8, 0.9, model.nq)
    pinocchio.framesForwardKinematics(model, data, q)
    placed: list[tuple[np.ndarray, Rotation]] = []
    for link in links:
        position, turn = np.array(link["position"]), Rotation.from_quat(link["quaternion"])
        if link["joint"]:
            angle = q[model.joints[model.getJointId(link["joint"])].idx_q]
            turn = turn * Rotation.from_rotvec(angle * np.array(link["axis"]))
        if link["parent"] >= 0:
            base, rotation = placed[link["parent"]]
            position, turn = base + rotation.apply(position), rotation * turn
        placed.append((position, turn))
        frame = data.oMf[model.getFrameId(link["name"])]
        np.testing.assert_allclose(position, frame.translation, atol=1e-12)
        np.testing.assert_allclose(turn.as_matrix(), frame.rotation, atol=1e-12)


def test_a_mesh_that_is_not_there_is_named() -> None:
    shape = '<visual><geometry><mesh filename="/no/such.stl"/></geometry></visual>'
    text = f'<robot name="a"><link name="b">{shape}</link></robot>'
    links, missing = links_of(text, Packer())
    assert (links[0]["shapes"], missing) == ([], ["/no/such.stl"])


def test_numbers_of_a_run() -> None:
    """Two of three ticks have a law, an effort and a squeeze."""
    nan, still, times = math.nan, np.zeros((3, 6)), np.arange(3.0)
    e = np.array([[0.03, 0.04, 0, 0.3, 0, 0.4], [nan] * 6, [0.0] * 6])
    slip = np.array([[0.0] * 6, [0.003, 0.004, 0, 0, 0.2, 0], [0, 0.001, 0, 0, 0, 0.1]])
    loads = np.array([[0.15, 0.2, 9, 9, 9, 0], [0, 0, 0, 0, 0, 0.00375], [0.0] * 6])
    law = np.column_stack((e, still, still, [2.0, nan, 4.0]))
    rows = {"slip": slip, "slip_velocity": 2.0 * slip, "wrench": loads, "law": law}
    rows["effort"] = np.array([[3.0, 0.0], [nan, nan], [0.0, -4.0]])
    symbols = (*(f"{kind}_{axis}" for kind in ("e", "position", "desired") for axis in AXES), "grip_command")
    parameters = {
        "governor.friction_limit": 0.25, "governor.torsional_radius": 0.03, "grip.nominal_force": 7.0,
        "contacts.slip_axes": [True, True, False, False, False, True, *[True] * 6],  # of two contacts
    }  # fmt: skip
    channels = {name: Channel(times, of) for name, of in rows.items()}
    arm = ArmData("", "", (), parameters, channels, symbols)
    np.testing.assert_allclose(load_ratio(arm), [1.0, 0.5, 0.0])
    after = {
        "slip_linear_m": 0.001, "slip_angular_rad": 0.1, "slip_linear_peak_m": 0.005, "slip_speed_peak_m_s": 0.01,
        "load_peak": 1.0,
    }  # fmt: skip
    of_law = {
        "tracking_rms_m": 0.05 / math.sqrt(2.0), "tracking_rms_rad": 0.5 / math.sqrt(2.0), "off_path_m": 0.05,
        "attitude_excursion_rad": 0.5, "final_error_m": 0.0, "final_error_rad": 0.0, "arrival_s": 0.0,
    }  # fmt: skip
    known = {"squeeze_mean_n": 3.0, "squeeze_peak_n": 4.0, "effort_peak_nm": 4.0, "effort_rate_rms_n_m_s": 5.0}
    assert summarise(arm) == pytest.approx(after | of_law | known)
    held = replace(arm, channels=channels | {name: Channel(times, nan * rows[name]) for name in ("law", "effort")})
    unknown = {"squeeze_mean_n": 7.0, "squeeze_peak_n": 7.0, "effort_peak_nm": 0.0, "effort_rate_rms_n_m_s": 0.0}
    assert summarise(held) == pytest.approx(after | dict.fromkeys(of_law, nan) | unknown, nan_ok=True)
    assert np.isnan(load_ratio(replace(arm, parameters={}))).all()


ROOT2, QUARTER = 0.1 * math.sqrt(2.0), math.pi / 2.0
LEVER = {"contacts.position": [0.0, 0.0, 0.1], "contacts.orientation_xyzw": [0.0, 0.0, 0.0, 1.0]}
GOALS = {
    "the end of the path": ({"kind": "quintic", "displacement": [0.3, 0.0, 0.0]}, 0.3, (0.0, 0.0, 2.0)),
    "not where the reference rests": ({"kind": "quintic", "displacement": [0.4, 0.0, 0.0]}, 0.3, (0.1, 0.0, math.nan)),
    "which it passes": ({"kind": "quintic", "displacement": [0.15, 0.0, 0.0]}, 0.3, (0.15, 0.0, math.nan)),
    "with the attitude": ({"kind": "quintic", "rotation": [0.0, 0.0, 0.2]}, 0.0, (0.0, 0.2, math.nan)),
    # the pad, 0.1 m above the centre that stays where it is, goes 0.1 m along x and 0.1 m down
    "of the object": ({"kind": "quintic", "of": "object", "rotation": [0, QUARTER, 0]}, 0, (ROOT2, QUARTER, math.nan)),
    "of a stream that rests": ({"kind": "topic"}, 0.3, (0.0, 0.0, 2.0)),
    "of a stream that moves": ({"kind": "topic"}, None, (math.nan, math.nan, math.nan)),
}  # fmt: skip


@pytest.mark.parametrize("name", GOALS)
def test_error_and_arrival_are_about_the_goal(name: str) -> None:
    """The pad follows its reference, which is at its end from the third of five samples on, or moves 0.1 m in each."""
    path, end, expected = GOALS[name]
    pose = np.zeros((5, 6))
    pose[:, 0] = 0.1 * np.arange(5) if end is None else end * np.array([0.0, 0.5, 1.0, 1.0, 1.0])
    symbols = tuple(f"{kind}_{axis}" for kind in ("position", "desired") for axis in AXES)
    law = Channel(np.arange(5.0), np.hstack((pose, pose)))
    arm = ArmData("", "", (), {f"trajectory.{k}": v for k, v in path.items()} | LEVER, {"law": law}, symbols)
    _, distances, angles = off_goal(arm)
    found = (distances[-1], angles[-1], arrival_s(arm))
    assert found == pytest.approx(expected, abs=1e-12, nan_ok=True)


def test_a_run_is_read_on_the_grid() -> None:
    bag = BAGS / "paper_planar_vic"
    data = read_data(bag)
    (arm,) = on_grid(data, grid(data.duration_s)).arms
    values = series_of(arm)
    numbers = summarise(data.arm(""))
    assert values["slip_mm"][-1] == pytest.approx(1e3 * numbers["slip_linear_m"], abs=1e-9)
    assert np.nanmax(values["slip_mm"]) <= 1e3 * numbers["slip_linear_peak_m"]
    assert np.isfinite(arm.channel("joints").rows).all()
    assert arm.modes[0][1].startswith("ACTIVE")


def test_two_arms_are_two_arms_of_one_run(tmp_path: Path) -> None:
    two_arms(BAGS / "paper_planar_vic", tmp_path / "bag")
    run = on_grid(read_data(tmp_path / "bag"), grid(1.0))
    assert [arm.name for arm in run.arms] == ["left", "right"]
    assert run.object_pose is not None
    (_, slip), *_ = plot_series([run])
    assert [(number, place) for number, place, _ in slip] == [(0, 0), (0, 1)]
    assert np.isfinite(slip[1][2]).all()
    assert list(summaries({"pair": read_data(tmp_path / "bag")})) == ["pair left", "pair right"]


def test_page_holds_everything_and_fetches_nothing(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    write_page(page, {"a <b>": read_data(BAGS / "paper_planar_vic")}, command="x", description="t & u")
    text = page.read_text()
    assert "a &lt;b&gt;" in text
    assert "t &amp; u" in text
    own = text[: text.index("<script>")] + text[text.rindex("<script>") :]
    assert re.findall(r'(?:src|href)="(?!data:)', own) == []
    data = re.search(r'id="data">([^<]+)<', text)
    assert data is not None
    model = unpack(gzip.decompress(base64.b64decode(data[1])))
    assert [plot["name"] for plot in model["plots"]][:2] == ["slip_mm", "slip_deg"]
