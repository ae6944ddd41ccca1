"""A node that waits says for what."""

from __future__ import annotations

import pytest

from slip_msgs_py.endpoint_matching import Waiting, time


def test_what_is_missing_is_said_after_a_moment_and_again(monkeypatch: pytest.MonkeyPatch) -> None:
    now, lines = [100.0], list[str]()
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    waiting = Waiting(lines.append)
    for now[0] in (100.5, 101.5, 102.0, 111.0, 112.0):
        waiting.tell(f"controller at {now[0]:g}")
    assert lines == ["waits: controller at 101.5", "waits: controller at 112"]
