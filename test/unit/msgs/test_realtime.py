"""Options of a real-time process on the way through its command line."""

from __future__ import annotations

import sys

import pytest

from slip_msgs_py.realtime import ProcessOptions, main


def test_refused_options_are_reported(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """A core and a priority that no machine has are refused in one line each, and the module still runs."""
    assert ProcessOptions().arguments() == []
    options = ProcessOptions((9998, 9999), fifo=1000, lock_memory=True)
    assert options.arguments() == ["--cpu", "9998,9999", "--fifo", "1000", "--lock-memory"]
    monkeypatch.setattr(sys, "argv", [])
    main([*ProcessOptions((9998, 9999), fifo=1000).arguments(), "test.support.call", "--", "word"])
    lines = "".join(capsys.readouterr())
    assert "core 9998, 9999 is not available" in lines
    assert "SCHED_FIFO 1000 is not permitted" in lines
    assert sys.argv[1:] == ["word"]
