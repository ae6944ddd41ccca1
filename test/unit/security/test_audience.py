"""Who may watch a run: other pages of the same browser read nothing."""

from __future__ import annotations

import contextlib
import socket
import urllib.error
import urllib.request
from collections.abc import Iterator

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from slip_vic.page.audience import MOST, Audience


@pytest.fixture
def audience() -> Iterator[Audience]:
    served = Audience(0)
    yield served
    served.close()


def page(port: int, **headers: str) -> int:
    """Return the status of the page."""
    request = urllib.request.Request(f"http://127.0.0.1:{port}/", headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=5.0) as response:
            return int(response.status)
    except urllib.error.HTTPError as error:
        return error.code


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"Host": "localhost:8765", "Origin": "http://localhost:8765"}, 200),
        ({"Host": "192.168.1.7"}, 403),
        ({"Host": "attacker.example:8765"}, 403),
        ({"Host": "localhost.attacker.example"}, 403),
        ({"Host": "1.2.3.4.attacker.example"}, 403),
        ({"Host": "localhost:8765", "Origin": "http://attacker.example"}, 403),
        ({"Host": "localhost:8765", "Origin": "null"}, 403),
    ],
)
def test_only_the_own_page_is_answered(audience: Audience, headers: dict[str, str], status: int) -> None:
    assert page(audience.port, **headers) == status


def test_another_page_of_the_browser_reads_no_live_data(audience: Audience) -> None:
    live = f"ws://127.0.0.1:{audience.port}/live"
    audience.begin(b"model")
    with connect(live, origin=f"http://127.0.0.1:{audience.port}") as own:
        assert [own.recv(5.0), own.recv(5.0)] == ["model", b"model"]
    with pytest.raises(InvalidStatus, match="403"), connect(live, origin="https://attacker.example"):
        pass


def test_connections_that_say_nothing_are_bounded(audience: Audience) -> None:
    idle = [socket.create_connection(("127.0.0.1", audience.port), 5.0) for _ in range(2 * MOST)]
    for ended in idle[MOST:]:
        with contextlib.suppress(ConnectionResetError):
            assert ended.recv(1) == b""
    for one in idle:
        one.close()


def test_who_comes_late_gets_the_newest_of_all(audience: Audience) -> None:
    audience.begin(b"an old model")
    audience.tell("ended", ended="over")
    audience.begin(b"model")
    for frame in (b"first", b"second"):
        audience.send(frame)
    audience.tell("ended", ended="why")
    with connect(f"ws://127.0.0.1:{audience.port}/live") as late:
        got = [late.recv(5.0) for _ in range(4)]
        audience.tell(arm=1, mode="HOLD")
        got.append(late.recv(5.0))
    assert got == ["model", b"model", b"second", '{"ended": "why"}', '{"arm": 1, "mode": "HOLD"}']
