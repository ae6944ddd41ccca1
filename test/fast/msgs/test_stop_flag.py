"""The wish to end is never lost: neither swallowed by who loads machine code, nor raised where a shell ignores it."""

from __future__ import annotations

import contextlib
import signal

from slip_msgs_py.stop_flag import StopFlag


def test_a_signal_that_was_swallowed_is_known_inside() -> None:
    with StopFlag(interrupts=True) as outer:
        with contextlib.suppress(KeyboardInterrupt):  # as ctypes callbacks do
            signal.raise_signal(signal.SIGINT)
        with StopFlag() as inner:
            assert outer()
            assert inner()
            signal.raise_signal(signal.SIGINT)  # raises nothing: the inner one is asked
    with StopFlag() as later:
        assert not later()


def test_hang_ups_that_are_ignored_stay_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with StopFlag() as stop:
            signal.raise_signal(signal.SIGHUP)
            assert not stop()
    finally:
        signal.signal(signal.SIGHUP, before)
