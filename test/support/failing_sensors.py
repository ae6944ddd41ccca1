"""How far the object slips where a sensor fails in motion: prints the table of docs/results.md."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from slip_vic.scenarios.scenario import Law, load_scenario
from test.support.watched_loop import Watched, WatchedLoop, with_joints

DRIVES = ("ideal", "torque_joint", "motor_current", "velocity_500", "position_250")
MOVES_MS = {"paper_planar": 1500, "vertical_plane": 1200, "glass_transport": 900}
"""When it fails: while the arm moves."""
LASTS_MS = 2000


def wrench_not_finite(arm: Any, _: Any) -> Any:
    """No wrench is a number."""
    return arm._replace(wrenches=tuple(replace(w, wrench=w.wrench * np.nan) for w in arm.wrenches))


def wrench_frozen(arm: Any, kept: Any) -> Any:
    """The wrench repeats what it was."""
    pairs = zip(arm.wrenches, kept.wrenches, strict=True)
    return arm._replace(wrenches=tuple(replace(w, wrench=k.wrench) for w, k in pairs))


def slip_invalid(arm: Any, _: Any) -> Any:
    """The slip sensor says that it measures nothing."""
    return arm._replace(slips=tuple(replace(s, valid=False) for s in arm.slips))


def joints_not_finite(arm: Any, _: Any) -> Any:
    """No position is a number."""
    return with_joints(arm, arm.joint.position * np.nan, arm.joint.velocity)


def joints_frozen(arm: Any, kept: Any) -> Any:
    """The joint states repeat what they were."""
    return with_joints(arm, kept.joint.position, kept.joint.velocity)


def velocity_outliers(arm: Any, _: Any) -> Any:
    """One joint velocity in a sample of fifty is off, by 3 rad/s (standard deviation)."""
    rng, velocity = np.random.default_rng(arm.joint.stamp_ns), arm.joint.velocity.copy()
    if rng.uniform() < 0.02:
        velocity[rng.integers(len(velocity))] += 3.0 * rng.normal()
    return with_joints(arm, arm.joint.position, velocity)


FAILURES: dict[str, Callable[[Any, Any], Any]] = {
    "wrench not finite": wrench_not_finite, "wrench frozen": wrench_frozen, "slip velocity invalid": slip_invalid,
    "joint states not finite": joints_not_finite, "joint states frozen": joints_frozen,
    "outliers of joint velocities": velocity_outliers,
}  # fmt: skip


def fail(what: str, scenario: str, drive: str, law: Law, lasts_ms: int = LASTS_MS) -> Watched:
    """Return what comes of a failure, from it on; what: of FAILURES."""
    run = WatchedLoop(load_scenario(scenario, law=law, drive=drive, sensor="event_1000"))
    for _ in range(MOVES_MS[scenario]):
        run.cycle()
    kept: list[Any] = []
    run.fastest = 0.0

    def sensed(arm: Any) -> Any:
        kept.append(arm)
        return FAILURES[what](arm, kept[0])

    return run.watch(lasts_ms, sensed)
