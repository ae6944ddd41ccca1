"""The wish to end, as a flag that loops ask: so that closing always happens."""

from __future__ import annotations

import signal
import sys
from typing import Any, Final

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopFlag:
    """Set by SIGINT, SIGTERM and SIGHUP from `install` on, or inside a `with` block; a loop asks by calling it.

    A KeyboardInterrupt inside a callback would be logged as fatal.

    Inside another one it begins with what that one knows, and ignored hang-ups (nohup) stay ignored.

    Args:
        interrupts: raise KeyboardInterrupt nevertheless, to leave work that asks nobody. Where machine code is compiled
            or loaded it is swallowed: whoever comes next has to ask.
    """

    def __init__(self, *, interrupts: bool = False) -> None:
        self._is_set = False
        self._interrupts = interrupts
        self.in_haste = False
        """Whether the signal was another one than SIGINT, which asks for an orderly end."""
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

    def _report_others(self, unraisable: Any) -> None:
        """Report what code that cannot raise swallows, but for our interrupts: who asks us learns of them."""
        if not isinstance(unraisable.exc_value, KeyboardInterrupt):
            self._report(unraisable)

    def _set(self, number: int, _frame: Any) -> None:
        self._is_set = True
        self.in_haste |= number != signal.SIGINT
        if self._interrupts:
            raise KeyboardInterrupt
