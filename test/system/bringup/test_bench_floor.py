"""The C program that the bench compares with."""

from __future__ import annotations

from pathlib import Path

import pytest

from test.campaigns.bench import cfloor


def test_the_c_floor_is_built_or_says_why_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library, reason = cfloor.build(tmp_path)
    assert (library is None) == bool(reason)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    assert cfloor.build(tmp_path) == (None, "no C compiler")
