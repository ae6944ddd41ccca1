"""Where a process of a run has its cores and its priority."""

from __future__ import annotations

import os
import sys

import pytest

from slip_core.errors import InputError
from slip_vic.run.processes import Child, placed

LAST_CORE = max(os.sched_getaffinity(0))
PROBE = "import os; print(sorted(os.sched_getaffinity(0)), os.sched_getscheduler(0))"


def test_cores_of_a_child() -> None:
    child = Child("probe", placed([sys.executable, "-c", PROBE], [LAST_CORE]), os.environ, lambda *_: None)
    assert child.has_ended(60.0)
    assert [*child.lines] == [f"[{LAST_CORE}] {os.SCHED_OTHER}"]


def test_a_priority_that_is_not_permitted_ends_the_child_with_the_reason() -> None:
    child = Child("probe", placed([sys.executable, "-c", PROBE], [], 1000), os.environ, lambda *_: None)
    assert child.has_ended(60.0)
    assert child.returncode != 0
    assert "chrt" in child.tail()


def test_a_program_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    for cores, fifo, program in (([LAST_CORE], None, "taskset"), ([], 80, "chrt")):
        with pytest.raises(InputError, match=f"{program}: .*util-linux"):
            placed([sys.executable], cores, fifo)
