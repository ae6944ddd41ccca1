"""DDS on this machine only: what the environment becomes, and when somebody has said otherwise."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from slip_msgs_py.localhost import OTHERWISE, PROFILES, RANGE, stay_on_this_machine


@pytest.fixture(autouse=True)
def nothing_said(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (RANGE, *OTHERWISE):
        monkeypatch.setenv(name, "")  # so that it is put back
        monkeypatch.delenv(name)


def test_by_default_the_profile_binds_udp_to_the_loopback_interface() -> None:
    stay_on_this_machine()
    assert os.environ[RANGE] == "LOCALHOST"
    space = "{http://www.eprosima.com}"
    root = ET.parse(Path(os.environ[PROFILES[0]])).getroot()
    addresses = [[a.text for a in t.iter(f"{space}address")] for t in root.iter(f"{space}transport_descriptor")]
    kinds = [t.findtext(f"{space}type") for t in root.iter(f"{space}transport_descriptor")]
    assert list(zip(kinds, addresses, strict=True)) == [("UDPv4", ["127.0.0.1"]), ("SHM", [])]
    assert root.find(f".//{space}participant").get("is_default_profile") == "true"  # type: ignore[union-attr]
    assert [node.text for node in root.iter(f"{space}useBuiltinTransports")] == ["false"]


def test_who_says_otherwise_is_obeyed(monkeypatch: pytest.MonkeyPatch) -> None:
    for reach in ("SUBNET", "OFF", "SYSTEM_DEFAULT"):
        monkeypatch.setenv(RANGE, reach)
        stay_on_this_machine()
        assert os.environ[RANGE] == reach
        assert PROFILES[0] not in os.environ
    monkeypatch.setenv(RANGE, "LOCALHOST")
    for name, value in ((PROFILES[1], "mine.xml"), ("ROS_STATIC_PEERS", "192.0.2.7")):
        monkeypatch.setenv(name, value)
        stay_on_this_machine()
        assert PROFILES[0] not in os.environ
        monkeypatch.delenv(name)
    monkeypatch.setenv(PROFILES[0], "mine.xml")
    stay_on_this_machine()
    assert os.environ[PROFILES[0]] == "mine.xml"
