"""Each package is a valid ROS package: an invalid package.xml would silently be taken for plain Python."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

SRC = Path(__file__).parents[2] / "src"
PACKAGES = sorted(path.name for path in SRC.iterdir() if (path / "setup.py").exists())


def test_all_five_packages_are_there() -> None:
    assert PACKAGES == ["slip_bringup", "slip_description", "slip_msgs_py", "slip_sim_bridge", "slip_vic_controller"]


@pytest.mark.parametrize("name", PACKAGES)
def test_package_xml_is_a_format_3_ament_python_package(name: str) -> None:
    root = ET.parse(SRC / name / "package.xml").getroot()
    assert root.tag == "package"
    assert root.get("format") == "3"
    for tag in ("name", "version", "description", "maintainer", "license"):
        assert (root.findtext(tag) or "").strip(), tag
    assert root.findtext("name") == name
    assert root.find("maintainer").get("email")
    assert root.findtext("export/build_type") == "ament_python"


@pytest.mark.parametrize("name", PACKAGES)
def test_package_has_what_ament_needs(name: str) -> None:
    folder = SRC / name
    assert (folder / "resource" / name).is_file()
    assert (folder / name / "py.typed").is_file()
    assert f"$base/lib/{name}" in (folder / "setup.cfg").read_text()
    assert 'extras_require={"test": ["pytest"]}' in (folder / "setup.py").read_text()


def test_versions_agree() -> None:
    versions = {ET.parse(SRC / name / "package.xml").getroot().findtext("version") for name in PACKAGES}
    assert len(versions) == 1
    (version,) = versions
    assert all(f'version="{version}"' in (SRC / name / "setup.py").read_text() for name in PACKAGES)
