"""The fault campaign in process: it holds, and its monitors can fail."""

from __future__ import annotations

import numpy as np
import pytest

from test.campaigns.faults.campaign import judge
from test.campaigns.faults.monitors import CommandMonitor, Promise
from test.campaigns.faults.plan import all_faults

SEED = 7
PROMISE = Promise(np.array([87.0, 12.0]), 1000.0, 0.005, 0.05, 0.004)
MS = 1_000_000
ZERO = np.zeros(2)


def test_promise_holds() -> None:
    """A part of every kind of fault; the campaign itself runs thousands."""
    faults = len(all_faults())
    for trial in range(0, faults, 5):
        verdict = judge(SEED, trial)
        assert verdict.violations == (), trial
        assert verdict.commands > 100, trial


@pytest.mark.parametrize(
    ("commands", "what"),
    [
        ([(0, [0.0, 0.0]), (4, [4.1, 0.0])], "steps in 4.000 ms"),
        ([(0, [0.0, 0.0]), (40, [5.1, 0.0])], "steps in 40.000 ms"),  # no more than the longest step
        ([(0, [0.0, 0.0]), (60, [4.1, 0.0])], "from what the joints feel"),
        ([(0, [4.1, 0.0])], "from what the joints feel"),
        ([(0, [0.0, np.inf])], "inf"),
        ([(0, [0.0])], "1 numbers"),
        ([(t, [min(4.0 * t / 4, 90.0), 0.0]) for t in range(0, 100, 4)], "above the limits"),
    ],
)
def test_command_monitor_sees(commands: list[tuple[int, list[float]]], what: str) -> None:
    monitor = CommandMonitor(PROMISE)
    for t, effort in commands:
        monitor.take(t * MS, np.array(effort), lambda: (ZERO,), t)
    assert len(monitor.violations) >= 1
    assert what in monitor.violations[0]
