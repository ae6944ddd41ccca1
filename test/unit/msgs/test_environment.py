"""How DDS sends: what the environment becomes, and when somebody has said otherwise."""

from __future__ import annotations

import os
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from slip_msgs_py.environment import LOCALHOST_ONLY, PEERS, PROFILES, RANGE, RMW, TRANSPORTS, choose_transport

NAMES = (RANGE, LOCALHOST_ONLY, PEERS, *PROFILES, TRANSPORTS, RMW)


@pytest.fixture(autouse=True)
def nothing_said(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in NAMES:
        monkeypatch.setenv(name, "")  # so that it is put back
        monkeypatch.delenv(name)


def chosen() -> dict[str, str]:
    choose_transport()
    return {name: os.environ[name] for name in NAMES if name in os.environ}


def is_ours(environment: dict[str, str]) -> bool:
    return environment.get(RANGE) == "SYSTEM_DEFAULT" and environment.get(PROFILES[0], "").endswith("localhost.xml")


def test_the_profile_has_udp_on_the_loopback_interface_and_nothing_else() -> None:
    space = "{http://www.eprosima.com}"
    root = ET.parse(Path(chosen()[PROFILES[0]])).getroot()
    addresses = [[a.text for a in t.iter(f"{space}address")] for t in root.iter(f"{space}transport_descriptor")]
    kinds = [t.findtext(f"{space}type") for t in root.iter(f"{space}transport_descriptor")]
    assert list(zip(kinds, addresses, strict=True)) == [("UDPv4", ["127.0.0.1"])]
    assert root.find(f".//{space}participant").get("is_default_profile") == "true"  # type: ignore[union-attr]
    assert [node.text for node in root.iter(f"{space}useBuiltinTransports")] == ["false"]


@pytest.mark.parametrize("said", [{}, {RANGE: "LOCALHOST"}, {LOCALHOST_ONLY: "1"}, {LOCALHOST_ONLY: "1", RANGE: "OFF"}])
def test_on_this_machine_the_profile_is_used(said: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in said.items():
        monkeypatch.setenv(name, value)
    assert is_ours(chosen())
    assert is_ours(chosen())  # by a child of this process
    assert os.environ.get(LOCALHOST_ONLY, "0") == "0"  # or rmw_fastrtps adds shared memory


@pytest.mark.parametrize("said", [{RANGE: "SUBNET"}, {RANGE: "OFF"}, {RANGE: "LOCALHOST", PEERS: "192.0.2.7"}])
def test_who_may_be_found_is_obeyed_and_udp_is_used(said: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in said.items():
        monkeypatch.setenv(name, value)
    assert chosen() == {**said, TRANSPORTS: "UDPv4"}
    monkeypatch.setenv(TRANSPORTS, "DEFAULT")
    assert chosen() == {**said, TRANSPORTS: "DEFAULT"}


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_of_the_user_is_left_alone(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(name, "mine.xml")
    assert chosen() == {name: "mine.xml"}


def test_another_middleware_stays_on_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(RMW, "rmw_cyclonedds_cpp")
    assert chosen()[RANGE] == "LOCALHOST"
