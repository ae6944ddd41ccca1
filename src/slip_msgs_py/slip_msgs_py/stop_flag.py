"""The wish to end: as a flag that loops ask, so that closing always happens, and as an end that nothing holds up."""

from __future__ import annotations

import _thread
import contextlib
import ctypes
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any, Final

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_PR_SET_PDEATHSIG: Final = 1


class StopFlag:
    """Set by SIGINT, SIGTERM and SIGHUP from `install` on, or inside a `with` block; a loop polls by calling it.

    A KeyboardInterrupt inside a callback would be logged as fatal.

    Inside another one it begins with what that one knows, and ignored hang-ups (nohup) stay ignored.

    Args:
        interrupts: raise KeyboardInterrupt too, to leave work that does not poll. A callback or a destructor, which
            cannot raise, swallows it: then it comes again until it is raised or an inner flag is set.
    """

    def __init__(self, *, interrupts: bool = False) -> None:
        self._is_set = False
        self._interrupts = interrupts
        self.in_haste = False
        """Whether the signal was another one than SIGINT, which requests an orderly end."""
        self._before: dict[signal.Signals, Any] = {}
        self._report = sys.unraisablehook

    def install(self) -> StopFlag:
        """Handle the signals until the process ends."""
        nohup = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        handled = [number for number in SIGNALS if not (nohup and number == signal.SIGHUP)]
        self._before = {number: signal.signal(number, self._set) for number in handled}
        if self._interrupts:
            self._report, sys.unraisablehook = sys.unraisablehook, self._report_others
        outer = [getattr(handler, "__self__", None) for handler in self._before.values()]
        self._is_set |= any(flag() for flag in outer if isinstance(flag, StopFlag))
        return self

    def __enter__(self) -> StopFlag:
        return self.install()

    def __exit__(self, *_: object) -> None:
        # CPython remembers a KeyboardInterrupt that passed through exec of a text (dataclasses do that) and, even if it
        # was caught, ends a `python -m` by the signal instead of by its exit code. The next text makes it forget.
        exec("")
        if self._interrupts:
            sys.unraisablehook = self._report
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def __call__(self) -> bool:
        """Return whether a signal has come."""
        return self._is_set

    def _report_others(self, unraisable: sys.UnraisableHookArgs) -> None:
        """Report what code that cannot raise swallows, but for our interrupts, which come again."""
        if isinstance(unraisable.exc_value, KeyboardInterrupt):
            number = signal.SIGTERM if self.in_haste else signal.SIGINT
            _thread.start_new_thread(os.kill, (os.getpid(), number))  # raised here it would be swallowed, too
        else:
            self._report(unraisable)

    def _set(self, number: int, _frame: FrameType | None) -> None:
        self._is_set = True
        self.in_haste |= number != signal.SIGINT
        if self._interrupts:
            raise KeyboardInterrupt


@contextlib.contextmanager
def held_back() -> Iterator[None]:
    """Let signals that request the end wait until the block ends; a process that it starts never hears Ctrl-C."""
    came = list[int]()
    handled = [number for number in SIGNALS if callable(signal.getsignal(number))]
    before = {number: signal.signal(number, lambda number, _: came.append(number)) for number in handled}
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited; other threads may get it all the same
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for number, handler in before.items():
            signal.signal(number, handler)
        for late in came:
            signal.raise_signal(late)


@contextlib.contextmanager
def ending(on_signal: Callable[[int], Any]) -> Iterator[None]:
    """Call a function in a thread of its own as soon as a signal comes that requests the end, inside the block.

    Python's handlers run in the main thread between two steps of Python: not while a library is loaded, machine code is
    compiled, or DDS waits for a lock. This thread hears the signals there too. Handlers have to be installed already.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals belong to the main thread
        return
    hear, tell = os.pipe()
    os.set_blocking(tell, False)

    def listen() -> None:
        while said := os.read(hear, 1):
            if said[0] in SIGNALS:
                on_signal(said[0])

    before = signal.set_wakeup_fd(tell, warn_on_full_buffer=False)
    listener = threading.Thread(target=listen, name="signals", daemon=True)
    listener.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(tell)
        listener.join(1.0)
        os.close(hear)


def end_with(parent: int) -> None:
    """End this process as soon as its parent ends, whose process id this is."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:  # it may have ended before the line above
        os._exit(0)
