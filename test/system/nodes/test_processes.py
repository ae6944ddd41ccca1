"""Children under supervision: they run where they were wished to, and what the system refuses is a warning."""

from __future__ import annotations

import os
import sys
from typing import Any

import pytest

from slip_vic.run.processes import ANYWHERE, Child, Scheduling

LAST_CORE = max(os.sched_getaffinity(0))
PROBE = "import os; print(sorted(os.sched_getaffinity(0)), os.sched_getscheduler(0))"


@pytest.mark.parametrize(
    ("wish", "cores", "warning"),
    [
        (ANYWHERE, os.sched_getaffinity(0), ""),
        (Scheduling((LAST_CORE,)), {LAST_CORE}, ""),
        (Scheduling((4095,)), os.sched_getaffinity(0), "core 4095 is not available; running on"),
        (Scheduling((10**9,)), os.sched_getaffinity(0), "core 1000000000 is not available; running on"),
        (Scheduling(fifo=1000), os.sched_getaffinity(0), "SCHED_FIFO 1000 is not permitted"),
    ],
)
def test_cores_and_priority_of_a_child(wish: Scheduling, cores: set[int], warning: str) -> None:
    told: list[Any] = []
    before = os.sched_getaffinity(0), os.sched_getscheduler(0)
    child = Child("probe", [sys.executable, "-c", PROBE], os.environ, lambda *event: told.append(event), wish)
    assert child.wait(60.0)
    assert [*child.lines] == [f"{sorted(cores)} {os.SCHED_OTHER}"]
    assert (os.sched_getaffinity(0), os.sched_getscheduler(0)) == before
    assert len(told) == bool(warning)
    for name, event in told:
        assert (name, event.kind) == ("probe", "warning")
        assert event.values["text"].startswith(warning)
