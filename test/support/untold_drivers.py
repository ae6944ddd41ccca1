"""What drivers of arms and slip sensors do and tell nobody: prints the table of docs/results.md."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from slip_vic.scenarios.scenario import Law, load_scenario
from test.support.failing_sensors import DRIVES
from test.support.watched_loop import Change, Watched, WatchedLoop, print_slips, with_joints

SCENARIOS = ("paper_planar", "vertical_plane", "glass_transport")
LASTS_MS = 5000
PERIOD_S = 1e-3


def repeated(times: int) -> Change:
    """Each joint state is sent so many times, under new stamps."""
    count, kept = 0, (np.zeros(0), np.zeros(0))

    def sensed(arm: Any) -> Any:
        nonlocal count, kept
        if count % times == 0:
            kept = arm.joint.position.copy(), arm.joint.velocity.copy()
        count += 1
        return with_joints(arm, *kept)

    return sensed


def low_pass(hz: float) -> Change:
    """Velocities pass a filter of first order."""
    weight, kept = 1.0 - math.exp(-2.0 * math.pi * hz * PERIOD_S), np.zeros(1)

    def sensed(arm: Any) -> Any:
        nonlocal kept
        kept = kept + weight * (arm.joint.velocity - kept)
        return with_joints(arm, arm.joint.position, kept)

    return sensed


def position_outliers(size: float) -> Change:
    """One position in a sample of a hundred is off, by so much (standard deviation) [rad]."""
    rng = np.random.default_rng(7)

    def sensed(arm: Any) -> Any:
        position = arm.joint.position.copy()
        if rng.uniform() < 0.01:
            position[rng.integers(len(position))] += size * rng.normal()
        return with_joints(arm, position, arm.joint.velocity)

    return sensed


def no_velocities() -> Change:
    """No joint state has velocities."""
    return lambda arm: with_joints(arm, arm.joint.position, arm.joint.velocity * np.nan)


def older(ms: int) -> Change:
    """Slip velocities are so much older than their stamps: a camera's images, stamped when they have been evaluated."""
    kept = deque([np.zeros(6)] * ms)

    def sensed(arm: Any) -> Any:
        kept.append(arm.slips[-1].twist if arm.slips else kept[-1])
        old = kept.popleft()
        return arm._replace(slips=tuple(replace(new, twist=old) for new in arm.slips))

    return sensed


UNTOLD: dict[str, Callable[[], Change]] = {
    "each joint state 4 times": lambda: repeated(4), "each joint state 10 times": lambda: repeated(10),
    "no velocities": no_velocities, "velocities through 50 Hz": lambda: low_pass(50.0),
    "velocities through 20 Hz": lambda: low_pass(20.0), "velocities through 10 Hz": lambda: low_pass(10.0),
    "outliers of positions, 20 mrad": lambda: position_outliers(0.02),
    **{f"slip {ms} ms older than stamped": partial(older, ms) for ms in (10, 20, 60)},
}  # fmt: skip


def drive_untold(what: str, scenario: str, drive: str, law: Law, lasts_ms: int = LASTS_MS) -> Watched:
    """Return what comes of a driver that does so from the start; what: of UNTOLD."""
    sensor = "" if drive == "ideal" else "event_1000"
    run = WatchedLoop(load_scenario(scenario, law=law, drive=drive, sensor=sensor))
    return run.watch(lasts_ms, UNTOLD[what]())


if __name__ == "__main__":
    print_slips("driver", UNTOLD, SCENARIOS, DRIVES, drive_untold)
