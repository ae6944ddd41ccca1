"""The wish to end is never lost: neither swallowed by who loads machine code, nor raised where a shell ignores it."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable

import pytest

from slip_msgs_py.stop_flag import StopFlag, held_back


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


def interrupt() -> None:
    signal.raise_signal(signal.SIGINT)


def test_a_swallowed_signal_comes_again(reported: list[object]) -> None:
    def swallows() -> None:
        called_back(interrupt)
        time.sleep(30.0)

    with StopFlag(interrupts=True) as stop, pytest.raises(KeyboardInterrupt):
        swallows()
    assert stop()
    assert reported == []


def test_an_inner_flag_is_set_and_raises_nothing() -> None:
    with StopFlag(interrupts=True) as outer:
        with pytest.raises(KeyboardInterrupt):
            interrupt()
        with StopFlag() as inner:
            assert outer()
            assert inner()
            interrupt()
    with StopFlag() as later:
        assert not later()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_wait_for_the_end_of_the_block(number: signal.Signals) -> None:
    steps = []

    def held() -> None:
        with held_back():
            os.kill(os.getpid(), number)
            steps.append("to the end")

    with StopFlag(interrupts=True), pytest.raises(KeyboardInterrupt):
        held()
    assert steps == ["to the end"]
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, [])


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
