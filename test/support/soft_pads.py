"""Soft pads before a sensor that looks at the object: prints the table of docs/results.md."""

from __future__ import annotations

import math

from slip_vic.scenarios.scenario import Law, load_scenario
from test.support.failing_sensors import DRIVES
from test.support.untold_drivers import LASTS_MS, SCENARIOS
from test.support.watched_loop import Watched, WatchedLoop

SENSORS = ("event_1000", "optical_flow_120")
TOLD = ("controller.governor.pre_sliding=1e-3",)
MASS, RADIUS, DAMPING = 0.5, 0.015, 0.2
"""Of the object [kg], of the pad [m]: what its stiffness against turning follows from; share of critical damping."""


def softness(stiffness: float) -> tuple[str, ...]:
    """Return pads of this stiffness along the surface [N/m], and a sensor that sees them give way."""
    damping, square = 2.0 * DAMPING * math.sqrt(stiffness * MASS), RADIUS**2
    return (
        "bridge.plant=elastic", "bridge.sensors.slip.sees_pads=true",
        f"bridge.pad.stiffness=[{stiffness}, {stiffness}, {stiffness}, 5.0, 5.0, {stiffness * square}]",
        f"bridge.pad.damping=[{damping}, {damping}, {damping}, 0.05, 0.05, {max(0.02, damping * square)}]",
    )  # fmt: skip


def on_soft_pads(
    stiffness: float, scenario: str, drive: str, law: Law, lasts_ms: int = LASTS_MS, *, sensor: str, told: bool
) -> Watched:
    """Return what comes of pads of this stiffness [N/m]; told: whether the controller knows that they give way."""
    words = (*softness(stiffness), *(TOLD if told else ()))
    run = WatchedLoop(load_scenario(scenario, law=law, drive=drive, sensor=sensor, assignments=words))
    return run.watch(lasts_ms, lambda arm: arm)


def main() -> None:
    """Print the table: slip with `event_1000` / with `optical_flow_120` [mm]."""
    print(f"| law | pads | scenario | {' | '.join(DRIVES)} |")
    print("|---" * (3 + len(DRIVES)) + "|")
    laws: tuple[tuple[Law, bool], ...] = (("governed", False), ("governed", True), ("vic", False), ("classical", False))
    for law, told in laws:
        for kilo in (10.0, 3.0, 1.5):
            for scenario in SCENARIOS:
                cells = []
                for drive in DRIVES:
                    runs = [
                        on_soft_pads(1e3 * kilo, scenario, drive, law, sensor=sensor, told=told) for sensor in SENSORS
                    ]
                    cells.append(" / ".join(f"{1e3 * run.slip:.1f}" for run in runs))
                name = f"{law}, told" if told else law
                print(f"| {name} | {kilo} kN/m | {scenario} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
