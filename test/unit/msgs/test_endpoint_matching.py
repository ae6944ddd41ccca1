"""A node that waits says for what, and is not given up while another one is still being imported."""

from __future__ import annotations

import threading
import time

import pytest

from slip_core.errors import ProtocolError
from slip_msgs_py import endpoint_matching, environment
from slip_msgs_py.endpoint_matching import Waiting, wait_until


@pytest.fixture(autouse=True)
def _own_lock(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))


def wait(condition=lambda: False, timeout_s: float = 0.05) -> tuple[bool, list[str]]:
    lines: list[str] = []
    done = wait_until(
        condition, spin_once=lambda seconds: time.sleep(seconds), should_stop=lambda: False, timeout_s=timeout_s,
        explain=lambda: "controller is not ready", waiting=Waiting(lines.append),
    )  # fmt: skip
    return done, lines


def test_who_waits_too_long_says_for_what() -> None:
    with pytest.raises(ProtocolError, match=r"waited 0.05 s: controller is not ready"):
        wait()


def test_who_has_time_left_waits_until_it_holds() -> None:
    turns = iter((False, False, True))
    assert wait(lambda: next(turns), timeout_s=1e6) == (True, [])
    assert not list(turns)


def test_nobody_is_given_up_who_is_still_starting() -> None:
    began, enough = threading.Event(), threading.Event()

    def start() -> None:
        with environment.starting():
            began.set()
            enough.wait()

    thread = threading.Thread(target=start)
    thread.start()
    began.wait()
    assert environment.another_starts()
    end = time.monotonic() + 0.3  # several times longer than it would wait for somebody who has not begun
    assert wait(lambda: time.monotonic() > end)[0]
    enough.set()
    thread.join()
    assert not environment.another_starts()


def test_what_is_missing_is_said_and_that_somebody_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(endpoint_matching, "FIRST_SAID_S", 0.0)
    turns = iter(range(5))
    assert wait(lambda: next(turns) == 3)[1] == ["waits: controller is not ready"]
    turns = iter(range(5))
    with environment.starting():
        assert "compiles its formulas" in wait(lambda: next(turns) == 3)[1][0]
