"""Regular expressions given on the command line."""

from __future__ import annotations

import re

from slip_core.errors import InputError


def check_patterns(**patterns: str) -> None:
    """Check the regular expressions of options; ``exclude_regex=...`` is ``--exclude-regex``.

    Raises:
        InputError: one that is none.
    """
    for name, pattern in patterns.items():
        try:
            re.compile(pattern)
        except re.error as error:
            option = f"--{name.replace('_', '-')}"
            raise InputError(option, got=pattern, expected="a regular expression", fix=str(error)) from None
