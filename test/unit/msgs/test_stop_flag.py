"""The wish to end is never lost: neither swallowed by who loads machine code, nor raised where a shell ignores it."""

from __future__ import annotations

import ctypes
import signal
import sys
from collections.abc import Callable

import pytest

from slip_msgs_py.stop_flag import StopFlag


def called_back(what: Callable[[], object]) -> None:
    """Call by way of ctypes, which loses what a callback raises; llvmlite loads machine code so."""
    ctypes.CFUNCTYPE(None)(lambda: (what(), None)[1])()


def fail() -> None:
    raise ValueError("of the callback")


@pytest.fixture
def reported(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """What Python reports that nobody could catch."""
    errors: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda what: errors.append(what.exc_type))
    return errors


def test_a_signal_that_was_swallowed_is_known_inside_and_not_reported(reported: list[object]) -> None:
    with StopFlag(interrupts=True) as outer:
        called_back(lambda: signal.raise_signal(signal.SIGINT))
        assert reported == []
        with StopFlag() as inner:
            assert outer()
            assert inner()
            signal.raise_signal(signal.SIGINT)  # raises nothing: the inner one is asked
    with StopFlag() as later:
        assert not later()


def test_what_else_a_callback_loses_is_reported(reported: list[object]) -> None:
    with StopFlag(interrupts=True):
        called_back(fail)
    called_back(fail)
    assert reported == [ValueError, ValueError]


def test_hang_ups_that_are_ignored_stay_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with StopFlag() as stop:
            signal.raise_signal(signal.SIGHUP)
            assert not stop()
    finally:
        signal.signal(signal.SIGHUP, before)
