"""Compiling once for a machine: the folder of the notes belongs to its user alone."""

from __future__ import annotations

import pytest

from slip_core.errors import InputError
from slip_vic.run.prepare import prepare


def test_cache_is_made_for_its_user_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")  # nothing to compile
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    prepare.__wrapped__()
    assert (tmp_path / "cache" / "slip_vic").stat().st_mode & 0o777 == 0o700
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null")
    with pytest.raises(InputError, match="set XDG_CACHE_HOME"):
        prepare.__wrapped__()
