"""A node that waits says for what."""

from __future__ import annotations

import time

import pytest

from slip_core.errors import ProtocolError
from slip_msgs_py import endpoint_matching
from slip_msgs_py.endpoint_matching import Waiting, wait_until


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


def test_what_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(endpoint_matching, "FIRST_SAID_S", 0.0)
    turns = iter(range(5))
    assert wait(lambda: next(turns) == 3)[1] == ["waits: controller is not ready"]
