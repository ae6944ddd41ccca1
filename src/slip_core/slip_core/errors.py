"""Errors that carry their data and a fix, printed as one line."""

from __future__ import annotations

import copyreg
import difflib
import importlib.util
from collections.abc import Iterable
from typing import Any


class SlipVicError(Exception):
    """Base of every error this suite raises on purpose; `exit_code` is what a process ends with."""

    exit_code = 1

    def __str__(self) -> str:
        """Return the error as a terminal can show it, whatever a file's names are."""
        return printable(super().__str__())

    def __reduce__(self) -> tuple[Any, ...]:
        """Come back from a worker process as what it is, without its arguments."""
        return copyreg.__newobj__, (type(self), *self.args), self.__dict__  # type: ignore[attr-defined]


def printable(text: str) -> str:
    """Return a text from elsewhere without control characters but new lines: each is shown as its escape sequence."""
    return "".join(sign if sign.isprintable() or sign == "\n" else ascii(sign)[1:-1] for sign in text)


class InputError(SlipVicError):
    """Bad input from the user: what it was, what was got, what is expected and how to fix it.

    Args:
        what: the thing that is wrong, e.g. ``parameter gains.k_s``.
        got: the value or state that was found, or the system's message.
        expected: what is allowed.
        fix: what to do about it; may be empty where `expected` says it all.
    """

    exit_code = 2

    def __init__(self, what: str, *, got: object, expected: str, fix: str = "") -> None:
        self.what, self.got, self.expected, self.fix = what, got, expected, fix
        line = f"{what}: got {_short(got)}, expected {expected}"
        super().__init__(" ".join(f"{line}; {fix}".split()) if fix else " ".join(line.split()))


class UnknownName(InputError):
    """A name that is none of those that are known; the nearest are offered.

    Args:
        kind: what it is the name of, e.g. ``scenario``.
        name: what was given.
        known: the names that are valid.
        where: where it was given, e.g. ``scenario file a.yaml``; may be empty.
        fix: what else can be done; may be empty.
    """

    def __init__(self, kind: str, name: str, known: Iterable[str], *, where: str = "", fix: str = "") -> None:
        expected = nearest(name, known)
        super().__init__(f"{kind} {name}", got="an unknown name", expected=expected, fix=fix)
        place = f"{where}: " if where else ""
        line = f"{place}unknown {kind} '{_short(name)}'; {expected}"
        self.args = (" ".join(f"{line} {fix}".split()),)


def require_extra(package: str, what: str, extra: str) -> None:
    """Check that an optional package is installed.

    Args:
        package: its import name.
        what: the command or option that needs it.
        extra: the extra of slip-vic that installs it.

    Raises:
        InputError: it is not installed.
    """
    if importlib.util.find_spec(package) is None:
        fix = f"pip install 'slip-vic[{extra}]'"
        error = InputError(what, got=f"no package {package}", expected="an optional package", fix=fix)
        error.args = (f"{what} needs {package}: {fix}",)
        raise error


class ProtocolError(SlipVicError):
    """A peer failed: a missing process, a message that never arrived, an incompatible QoS."""


def nearest(name: str, known: Iterable[str]) -> str:
    """Return "did you mean a, b?" for the known names close to `name`, or the full list where none is close."""
    known = sorted(known)
    close = difflib.get_close_matches(name, known, cutoff=0.5)
    if close:
        return f"did you mean {', '.join(close)}?"
    return f"known: {', '.join(known) or 'none'}"


def _short(value: object, limit: int = 120) -> str:
    if isinstance(value, OSError):
        value = value.strerror or str(value)
    text = value if isinstance(value, str) else repr(value)
    return text if len(text) <= limit else f"{text[: limit - 3]}..."
