"""What drivers do with joint states and tell nobody: prints the table of docs/results.md."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from slip_vic.scenarios.scenario import Law, load_scenario
from test.support.failing_sensors import DRIVES
from test.support.watched_loop import Change, WatchedLoop, with_joints

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


UNTOLD: dict[str, Callable[[], Change]] = {
    "each joint state 4 times": lambda: repeated(4), "each joint state 10 times": lambda: repeated(10),
    "no velocities": no_velocities, "velocities through 50 Hz": lambda: low_pass(50.0),
    "velocities through 20 Hz": lambda: low_pass(20.0), "velocities through 10 Hz": lambda: low_pass(10.0),
    "outliers of positions, 20 mrad": lambda: position_outliers(0.02),
}  # fmt: skip


class Untold(NamedTuple):
    """Slip [m], fastest joint [rad/s], and the modes with their reasons."""

    slip: float
    fastest: float
    said: list[str]


def drive_untold(what: str, scenario: str, drive: str, law: Law, lasts_ms: int = LASTS_MS) -> Untold:
    """Return what comes of a driver that does so from the start; what: of UNTOLD."""
    sensor = "" if drive == "ideal" else "event_1000"
    run, sensed, said = WatchedLoop(load_scenario(scenario, law=law, drive=drive, sensor=sensor)), UNTOLD[what](), [""]
    for _ in range(lasts_ms):
        result = run.cycle(sensed)
        if said[-1] != f"{result.mode.name} {result.reason}":
            said.append(f"{result.mode.name} {result.reason}")
    return Untold(run.slip, run.fastest, said[1:])


def main() -> None:
    """Print a row for each driver, law and scenario: slip [mm] by drive, and the fastest joint of all [rad/s]."""
    laws: tuple[Law, ...] = ("governed", "vic")
    print(f"| driver | law | scenario | {' | '.join(DRIVES)} | fastest joint |")
    print("|---" * (4 + len(DRIVES)) + "|")
    for what in UNTOLD:
        for law in laws:
            for scenario in SCENARIOS:
                runs = [drive_untold(what, scenario, drive, law) for drive in DRIVES]
                slips = " | ".join(f"{1e3 * run.slip:.1f}" for run in runs)
                print(f"| {what} | {law} | {scenario} | {slips} | {max(r.fastest for r in runs):.1f} |", flush=True)


if __name__ == "__main__":
    main()
