"""URDF from files: plain, by package://, and expanded from xacro, whose packages are found without ROS."""

from __future__ import annotations

from pathlib import Path

import pytest

from slip_core.errors import InputError
from slip_core.files.resources import PACKAGES, add_package, find_file
from slip_core.files.urdf import named, parse_urdf
from slip_core.files.urdf_file import read_urdf
from slip_description import urdf_text
from slip_vic.cli import main
from slip_vic.scenarios.scenario import load

xacro = pytest.importorskip("xacro")  # in requirements.lock

HEAD = '<robot name="beam" xmlns:xacro="http://www.ros.org/wiki/xacro">'
PARTS = f"""{HEAD}
  <xacro:macro name="joint" params="number length">
    <link name="link{{n}}"><visual><geometry><mesh filename="package://made_meshes/beam.stl"/></geometry></visual>
      <inertial><mass value="${{2 * length}}"/>
        <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="joint{{n}}" type="revolute"><parent link="link${{number - 1}}"/><child link="link{{n}}"/>
      <origin xyz="0 0 ${{length}}"/><limit lower="-1" upper="1" effort="9" velocity="2"/></joint>
  </xacro:macro>
</robot>""".replace("{n}", "${number}")
BEAM = f"""{HEAD}
  <xacro:arg name="length" default="0.25"/>
  <xacro:include filename="$(find made_parts)/xacro/parts.xacro"/>
  <link name="link0"/>
  <xacro:joint number="1" length="$(arg length)"/>
  <xacro:joint number="2" length="${{2 * $(arg length)}}"/>
</robot>"""


@pytest.fixture(autouse=True)
def no_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give back what --package sets."""
    monkeypatch.setenv(PACKAGES, "")
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "parts" / "xacro").mkdir(parents=True)
    (tmp_path / "parts" / "xacro" / "parts.xacro").write_text(PARTS)
    (tmp_path / "beam.urdf.xacro").write_text(BEAM)
    return tmp_path / "beam.urdf.xacro"


def expect_beam(text: str) -> None:
    root = parse_urdf(text)
    assert list(named(root, "joint")) == ["joint1", "joint2"]
    assert [joint.find("origin").get("xyz") for joint in root.findall("joint")] == ["0 0 0.25", "0 0 0.5"]
    assert [link.find("inertial/mass").get("value") for link in root.findall("link")[1:]] == ["0.5", "1.0"]


def test_xacro_is_expanded_with_the_packages_that_are_named(file: Path) -> None:
    with pytest.raises(InputError, match=r"made_parts.*--package made_parts=DIR"):
        read_urdf(str(file), "arm")
    add_package(f"made_parts={file.parent / 'parts'}")
    expect_beam(read_urdf(str(file), "arm"))


def test_packages_are_found_as_ros_finds_them(file: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "install" / "share").mkdir(parents=True)
    (tmp_path / "install" / "share" / "made_parts").symlink_to(tmp_path / "parts")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    expect_beam(read_urdf(str(file), "arm"))


def test_what_is_named_goes_before_what_is_installed(tmp_path: Path) -> None:
    uri = "package://slip_description/urdf/arm.urdf"
    assert find_file(uri).read_text() == urdf_text()
    (tmp_path / "urdf").mkdir()
    (tmp_path / "urdf" / "arm.urdf").write_text("<robot/>")
    add_package(f"slip_description={tmp_path}")
    assert read_urdf(uri, "arm") == "<robot/>"
    assert find_file("file:///a/b") == Path("/a/b")


def test_arguments_are_given_or_named(file: Path) -> None:
    """One that has no default is required; xacro itself accepts none."""
    add_package(f"made_parts={file.parent / 'parts'}")
    twice = read_urdf(str(file), "URDF", {"length": "0.5"})
    assert [joint.find("origin").get("xyz") for joint in parse_urdf(twice).findall("joint")] == ["0 0 0.5", "0 0 1.0"]
    required = BEAM.replace(' default="0.25"', "").replace('name="beam"', 'name="$(arg length)"')
    file.write_text(required.replace("<xacro:include", '<xacro:arg name="mass" default="2"/><xacro:include'))
    with pytest.raises(InputError, match=r"--arg NAME:=VALUE gives its arguments: length, mass \(default '2'\)"):
        read_urdf(str(file), "URDF")
    expect_beam(read_urdf(str(file), "URDF", {"length": "0.25"}))


def test_xacro_that_cannot_be_expanded_is_one_line(file: Path, tmp_path: Path) -> None:
    add_package(f"made_parts={file.parent / 'parts'}")
    loop = '<xacro:macro name="m" params="a"><xacro:m a="1"/></xacro:macro><xacro:m a="1"/>'
    for inner in ("<link", '<link name="${nothing}"/>', '<xacro:include filename="absent.xacro"/>', "<xacro:m/>", loop):
        bad = tmp_path / "bad.xacro"
        bad.write_text(f"{HEAD}{inner}</robot>")
        with pytest.raises(InputError, match=r"bad\.xacro") as found:
            read_urdf(str(bad), "arm")
        assert "\n" not in str(found.value), inner
    expect_beam(read_urdf(str(file), "arm"))  # nothing of it stays
    with pytest.raises(InputError, match=r"absent\.xacro"):
        read_urdf(str(tmp_path / "absent.xacro"), "arm")


def test_a_package_is_a_name_and_a_folder(tmp_path: Path) -> None:
    for text in ("made_parts", "=/tmp", f"a={tmp_path}/absent"):
        with pytest.raises(InputError, match="--package"):
            add_package(text)


def test_commands_take_xacro(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """An arm in xacro is read by `arm` and by `--set`; too few joints are found in the expanded one."""
    command = ["slip-vic", "arm", str(file), "--package", f"made_parts={tmp_path / 'parts'}"]
    monkeypatch.setattr("sys.argv", command)
    assert main() == 2
    assert "joint1, joint2" in capsys.readouterr().err
    whole = tmp_path / "arm.xacro"
    whole.write_text(f'{HEAD}<xacro:include filename="$(find slip_description)/urdf/arm.urdf"/></robot>')
    made = load("paper_planar", law="vic", set={"robot_description_file": str(whole)})
    assert set(named(parse_urdf(made.urdf), "joint")) == set(named(parse_urdf(urdf_text()), "joint"))
