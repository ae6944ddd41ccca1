"""A guard for tests that must not start processes or open DDS: it sees every way that Python has to start one.

Allowed is this interpreter with the compiler switched off: checks that run formulas interpreted need a process in which
the compiler never started.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
from collections.abc import Iterator, Mapping
from typing import Any

import rclpy.context

STARTS = (
    "subprocess.Popen",
    "os.fork",
    "os.forkpty",
    "os.posix_spawn",
    "os.spawn",
    "os.exec",
    "os.system",
    "pty.spawn",
)
INTERPRETED = "NUMBA_DISABLE_JIT"
"""With this variable set to 1 the compiler does not run."""


class Forbidden(AssertionError):
    """A process or DDS where neither belongs."""


class _Guard:
    """An audit hook stays for as long as the interpreter runs, so it has a switch."""

    def __init__(self) -> None:
        self.on = False
        self.installed = False

    def install(self) -> None:
        if not self.installed:
            importlib.import_module("matplotlib.font_manager")  # asks fc-list for fonts, once on a machine
            sys.addaudithook(self.hear)
            self.installed = True

    def hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.on and event in STARTS and not _interpreted_check(event, arguments):
            raise Forbidden(
                f"a test of the fast tier started a process: {event} {arguments[:2]}; it belongs in test/system"
            )


GUARD = _Guard()


def _interpreted_check(event: str, arguments: tuple[Any, ...]) -> bool:
    if event not in ("subprocess.Popen", "os.posix_spawn"):
        return False
    environment = arguments[-1] if event == "subprocess.Popen" else arguments[2]
    value = _lookup(environment if environment is not None else os.environ)
    program = arguments[1][0] if arguments[1] else arguments[0]
    return os.fspath(program) == sys.executable and value == "1"


def _lookup(environment: Mapping[Any, Any]) -> str | None:
    return next((os.fsdecode(value) for name, value in environment.items() if os.fsdecode(name) == INTERPRETED), None)


def _refuse(*_: object, **__: object) -> None:
    raise Forbidden("a test of the fast tier opened DDS (rclpy.init); it belongs in test/system")


@contextlib.contextmanager
def forbidden() -> Iterator[None]:
    """Let no process start and no DDS open while the block runs."""
    GUARD.install()
    context: Any = rclpy.context.Context
    before, context.init = context.init, _refuse
    GUARD.on = True
    try:
        yield
    finally:
        GUARD.on = False
        context.init = before
